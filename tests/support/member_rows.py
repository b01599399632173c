"""The table of members: each operation with a type of body, each member with a value, and what
differs by it.

What a row is, and the effects of members that mean the same everywhere, stand in
`tests.support.members`. The type of a body stands behind the operation where it is not JSON.
"""

from dataclasses import replace

from tests.support.member_rows_of_files import FILES
from tests.support.member_rows_of_results import RESULTS
from tests.support.member_rows_of_things import THINGS
from tests.support.member_rows_within import WITHIN

MEMBERS = {
    name: replace(body, members={**body.members, **WITHIN.get(name, {})})
    for name, body in {**THINGS, **FILES, **RESULTS}.items()
}
assert WITHIN.keys() <= MEMBERS.keys()
