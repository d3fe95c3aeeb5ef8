"""What each method and each lever does to the target's water, in the tank and in the paper's own world."""
