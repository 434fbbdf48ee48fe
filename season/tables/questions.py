"""Questions to the tables that are ready: SQL that people need often."""

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Question:
    """A question.

    Attributes:
        words: what it asks.
        sql: of the answer.
    """

    words: str
    sql: str


QUESTIONS: Final = {
    "jumps": Question(
        "how many jumps there are, by season, hill and day",
        "SELECT season, hill, day, count(*) AS jumps, count(DISTINCT athlete) AS athletes, "
        "count_if(NOT ok) AS to_look_at FROM jumps GROUP BY ALL ORDER BY day, hill",
    ),
    "look": Question(
        "which jumps a person should look at, the newest first",
        "SELECT time_utc, hill, athlete, verdict, report FROM jumps WHERE NOT ok ORDER BY time_utc DESC",
    ),
    "best": Question(
        "the fastest take-offs, perpendicular to the table",
        "SELECT athlete, hill, gate, day, perpendicular_m_per_s, perpendicular_sigma_m_per_s, report FROM jumps "
        "WHERE ok AND perpendicular_m_per_s IS NOT NULL ORDER BY perpendicular_m_per_s DESC LIMIT 50",
    ),
    "failed": Question(
        "which logs could not be measured, and why",
        "SELECT log, hill, problem, duration_s FROM logs WHERE state = 'failed' ORDER BY log",
    ),
    "cameras": Question(
        "where the cameras stood, day by day",
        "SELECT hill, camera, min(recording) AS first, count(*) AS logs, avg(X0_X_m) AS X0_X_m, avg(X0_Y_m) AS X0_Y_m, "
        "avg(X0_Z_m) AS X0_Z_m, sqrt(avg(X0_X_sigma_m ** 2)) AS X0_X_sigma_m, "
        "sqrt(avg(X0_Y_sigma_m ** 2)) AS X0_Y_sigma_m, sqrt(avg(X0_Z_sigma_m ** 2)) AS X0_Z_sigma_m FROM cameras "
        "GROUP BY hill, camera, recording[:10] "
        "ORDER BY hill, camera, first",
    ),
}
