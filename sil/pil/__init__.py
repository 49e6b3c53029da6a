"""The firmware on this machine: as a host library, and on an emulated Cortex-M.

Processes of their own, never imported by the laboratory; they import the cable and nothing else of ours.
"""
