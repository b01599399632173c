"""Search over everything that a user may see: fields, filters in CQL2 text, pages of rows."""
