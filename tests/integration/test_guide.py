"""The guide as the service gives it: without a key, under a policy that lets a browser ask nobody else."""

import httpx

from service.app.supervisor import LocalService
from service.show.guide.contents import addresses


def test_every_page_of_the_guide_is_served_to_anybody(service: LocalService) -> None:
    with httpx.Client(base_url=f"{service.url}/guide/") as anybody:
        for address in addresses():
            answer = anybody.get(address)
            assert answer.status_code == 200, address
            policy = answer.headers["content-security-policy"]
            assert policy.startswith("default-src 'none'")
            assert "script" not in policy
            assert "unsafe" not in policy
        front = anybody.get("")
        assert front.text == anybody.get("index.html").text
        assert anybody.get("images/beam.svg").headers["content-type"] == "image/svg+xml"
        assert anybody.get("", headers={"if-none-match": front.headers["etag"]}).status_code == 304
        assert anybody.get(f"{service.url}/guide").headers["location"] == "guide/"
        for wrong in ("nowhere.html", "index.md", "../app.py", "%2e%2e/app.py", "decisions/", "x" * 5000):
            assert anybody.get(wrong).status_code == 404, wrong
        style = front.text.partition('rel="stylesheet" href="')[2].partition('"')[0]
        assert anybody.get(style).headers["content-type"].startswith("text/css")
