"""Bags as NumPy, CSV, Parquet, OpenSim's formats, and as a bag with one message per sample; needs no ROS."""
