"""Mode sets of a campaign, typed in, from a file or identified; and the job that identifies them
from its FRFs.
"""
