"""Archives: campaigns with all that was measured and found, as one file that others read without
this service.
"""
