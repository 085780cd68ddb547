"""Who moves a joint rightly? Tasks and engines."""
