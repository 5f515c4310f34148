"""Command `hric port`: parts of a ros_control controller that HRIC has, too, and a package for its port."""
