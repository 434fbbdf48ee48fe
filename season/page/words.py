# ruff: noqa: E501 - a text stands beside its translation
"""What the page of a season says, in English and Norwegian; a reader switches between them on the page."""

from typing import Final

from analysis.report.language import LANGUAGES, Said, shown

TEXTS: Final = {
    "language": ("Language", "Språk"),
    "counts": ("{jumps} · {athletes} · {hills} · {days}", "{jumps} · {athletes} · {hills} · {days}"),
    "jumps": ("{count} jumps", "{count} hopp"),
    "jumps_one": ("{count} jump", "{count} hopp"),
    "athletes": ("{count} athletes", "{count} utøvere"),
    "athletes_one": ("{count} athlete", "{count} utøver"),
    "hills_counted": ("{count} hills", "{count} bakker"),
    "hills_counted_one": ("{count} hill", "{count} bakke"),
    "days": ("{count} days", "{count} dager"),
    "days_one": ("{count} day", "{count} dag"),
    "between": ("{first} to {last}", "{first} til {last}"),
    "nothing": ("No jump is measured yet.", "Ingen hopp er målt ennå."),
    "look": ("Jumps to look at first ({count})", "Hopp å se på først ({count})"),
    "look_how": ("Their measurement cannot be trusted as it is. They count in no mean below.", "Målingen av dem er ikke til å stole på slik den er. De teller ikke i noe gjennomsnitt nedenfor."),
    "failed": ("Logs that could not be measured ({count})", "Logger som ikke kunne måles ({count})"),
    "more": ("and {count} more: svev season query --ask {ask}", "og {count} til: svev season query --ask {ask}"),
    "unnamed": ("no name", "uten navn"),
    "quantity": ("{quantity}, {distance} m from the edge", "{quantity}, {distance} m fra kanten"),
    "takeoff": ("{quantity} at the take-off", "{quantity} i satsen"),
    "athletes_how": ("From the largest to the smallest mean. Each dot is a good jump and leads to its report; the upright line is the mean, the thick bar twice its standard deviation. On the right the same jumps over the days of jumping: the mean of each day in a band of twice its standard deviation.", "Fra det største til det minste gjennomsnittet. Hver prikk er et godt hopp og fører til rapporten; den loddrette streken er gjennomsnittet, den tykke to standardavvik til hver side. Til høyre de samme hoppene over hoppdagene: dagens gjennomsnitt i et bånd på to standardavvik."),
    "stars_how": ("A star: differs from the others who jumped on the same days on the same hill (t test of the days' differences, at least three days), corrected for how many athletes are compared (false discovery rate): of twenty stars one is expected to be false.", "Stjerne: skiller seg fra de andre som hoppet de samme dagene i samme bakke (t-test av dagenes forskjeller, minst tre dager), korrigert for hvor mange utøvere som sammenlignes: av tjue stjerner ventes én å være falsk."),
    "from_others": ("{difference}{unit} from the others, p {p}", "{difference}{unit} fra de andre, p {p}"),
    "no_test": ("not compared: fewer than three days with others", "ikke sammenlignet: færre enn tre dager med andre"),
    "strip": ("{athlete}: jumps over {quantity}, {unit}", "{athlete}: hopp over {quantity}, {unit}"),
    "course": ("{athlete}: {quantity} over the days, {unit}", "{athlete}: {quantity} over dagene, {unit}"),
    "scale": ("scale, {unit}", "skala, {unit}"),
    "hills": ("Means of the days of each hill, in bands of twice their standard deviation. Other athletes and other wind count in it, not the hill alone.", "Dagenes gjennomsnitt i hver bakke, i bånd på to standardavvik. Andre utøvere og annen vind teller med, ikke bakken alene."),
    "cameras": ("Drift of the cameras", "Kameraenes vandring"),
    "cameras_how": ("Position of each camera as its logs oriented it, day by day, from its median; bands of twice the standard deviation.", "Posisjonen til hvert kamera slik loggene orienterte det, dag for dag, fra medianen; bånd på to standardavvik."),
    "camera": ("{hill}, {camera}: X, Y and Z from the median, mm", "{hill}, {camera}: X, Y og Z fra medianen, mm"),
}  # fmt: skip


def said(key: str, **values: object) -> Said:
    """A text with its values; a value that is itself a `Said` appears in each language's own words."""
    return Said(
        *(
            TEXTS[key][place].format(
                **{name: value.of(language) if isinstance(value, Said) else value for name, value in values.items()}
            )
            for place, language in enumerate(LANGUAGES)
        )
    )


def counted(key: str, count: int) -> Said:
    """So many of something."""
    return said(f"{key}_one" if count == 1 else key, count=count)


def text(key: str, tag: str = "span", **values: object) -> str:
    """A text as an element in each language."""
    return shown(said(key, **values), tag)
