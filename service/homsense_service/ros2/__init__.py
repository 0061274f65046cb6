"""ROS 2 robots with no node of ours: their own topics over zenoh, into the same sessions."""
