"""A page beside other editions of itself."""

import json

import pytest

pytestmark = pytest.mark.browser


def beside(page, site, here, root):
    """The notation page, published in a site of two editions: its foot, and where its links lead."""
    versions = [{"name": "v0.2", "folder": ""}, {"name": "v0.1", "folder": "v0.1/"}]
    listing = json.dumps({"here": here, "root": root, "versions": versions})
    page.route("**/versions.json", lambda route: route.fulfill(body=listing, content_type="application/json"))
    with page.expect_response("**/versions.json"):
        page.goto(f"{site}/notation.html", wait_until="load")
    page.wait_for_selector(".edition a")
    assert page.complaints == []
    return page.inner_text(".edition"), [a.get_attribute("href") for a in page.locator(".edition a").all()]


def test_the_newest_edition_names_the_old_one(page, site):
    words, links = beside(page, site, "v0.2", "./")
    assert words.startswith("Version ") and words.endswith("Other editions: v0.1.")
    assert links == [f"{site}/v0.1/"] and page.locator(".old-edition").count() == 0


def test_an_old_edition_says_that_it_is_old_and_where_the_newest_is(page, site):
    _, links = beside(page, site, "v0.1", "../elsewhere/")
    assert links == [f"{site}/elsewhere/"]
    assert page.inner_text(".old-edition") == "This is edition v0.1. The newest is v0.2."


def test_a_site_of_one_edition_names_no_other(page, site):
    with page.expect_response("**/versions.json") as answered:
        page.goto(f"{site}/notation.html", wait_until="networkidle")
    assert len(answered.value.json()["versions"]) == 1
    assert page.locator(".edition a, .old-edition").count() == 0 and page.complaints == []
