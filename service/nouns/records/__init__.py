"""Time blocks of hammer tests, their judgement, and the jobs that turn them into FRFs."""
