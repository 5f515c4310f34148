"""Bags and run folders without ROS: parts, records, health, export."""
