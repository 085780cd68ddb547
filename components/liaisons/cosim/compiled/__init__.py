"""Calls as records that C code makes: prepared calls in, compiled libraries of loop and coupled step out."""
