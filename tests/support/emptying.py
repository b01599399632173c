"""A migrated database as it was before a test: without rows, its sequences at their start, nobody
connected.
"""

import psycopg
from psycopg.sql import SQL

from service.platform.db.engine import psycopg_url
from tests.support.waiting import PATIENCE

_PRINT = SQL(
    """
SELECT concat_ws(' ', (SELECT string_agg(version_num, ' ') FROM alembic_version), (SELECT count(*) FROM pg_class), max(at))
FROM (
  SELECT max(xmin::text::bigint) FROM pg_class WHERE relnamespace = 'public'::regnamespace UNION ALL
  SELECT max(xmin::text::bigint) FROM pg_attribute UNION ALL
  SELECT max(xmin::text::bigint) FROM pg_constraint UNION ALL
  SELECT max(xmin::text::bigint) FROM pg_trigger UNION ALL
  SELECT max(xmin::text::bigint) FROM pg_proc
) catalogues (at)
"""
)  # of the newest transaction that changed the schema, which a collection of statistics is none of

_CUT_OFF = SQL("""
SELECT pg_terminate_backend(pid, {}) FROM pg_stat_activity
WHERE datname = current_database() AND pid <> pg_backend_pid() AND backend_type = 'client backend'
""")

_EMPTY = SQL("""
DO $$
DECLARE name regclass;
BEGIN
  SET LOCAL session_replication_role = replica; -- no trigger, no look at other tables
  FOR name IN SELECT oid FROM pg_class WHERE relnamespace = 'public'::regnamespace AND relkind = 'r'
      AND relname <> 'alembic_version' AND pg_relation_size(oid) > 0 LOOP
    EXECUTE format('DELETE FROM %s', name);
  END LOOP;
  PERFORM setval(seqrelid::regclass, seqstart, false) FROM pg_sequence;
END $$
""")


def schema_print(url: str) -> str:
    """What changes with every change of the schema."""
    with psycopg.connect(psycopg_url(url)) as connection:
        return str(connection.execute(_PRINT).fetchall()[0][0])


def empty_tables(url: str) -> str:
    """Cut off who is connected, and delete every row but the revision; the print of the schema that
    is left.
    """
    with psycopg.connect(psycopg_url(url)) as connection:
        connection.execute(_CUT_OFF.format(int(1000 * PATIENCE)))
        connection.execute(_EMPTY)
        return str(connection.execute(_PRINT).fetchall()[0][0])
