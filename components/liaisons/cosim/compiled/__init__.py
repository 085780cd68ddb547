"""Calls as records that C code makes: prepared calls in, one compiled library for loop and coupled step out."""
