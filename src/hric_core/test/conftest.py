from real_master import ros, roscore

__all__ = ["ros", "roscore"]
