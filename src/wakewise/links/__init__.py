"""Links to real vehicles; the only room that knows pymavlink. `logs/` reads what they recorded."""
