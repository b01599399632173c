"""Looking at a file before it is sent into a campaign: what it holds, and what it states."""
