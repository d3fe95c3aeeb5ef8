"""The worlds in which users have the trouble, and what each method leaves of them (`wakewise bench worlds`)."""
