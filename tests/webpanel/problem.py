"""What every refusal must be."""

import httpx

from webpanel.models import Problem


def refused(answer: httpx.Response, status: int) -> Problem:
    """See that an answer is a problem of this status, and return it."""
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = Problem.model_validate(answer.json())
    assert problem.status == status
    assert problem.title
    assert problem.code
    assert problem.detail
    assert "\n" not in problem.detail
    return problem
