"""What a worker runs in a child process: read a file, process hits, identify, update, judge.

Neither database nor web is loaded here.
"""
