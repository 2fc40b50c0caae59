"""Motions as files for drives (CiA 402), PLCs (IEC 61131-3) and ROS 2."""
