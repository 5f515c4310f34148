"""Export of bags to NumPy, CSV, Parquet, c3d, OpenSim's formats, or bags with one message per sample. No ROS."""
