"""ROS 2 node of Wakewise: a wrench in, thrusts out that stay within limits and spare a target."""
