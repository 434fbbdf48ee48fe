/** Norwegian words of what was measured, over the pictures and beside them. */
export const viewing = {
  "jump.number": "Hopp {jump}",
  "jump.which": "Hopp i dette opptaket",
  "jump.stick": "Strekfigur",
  "jump.full_screen": "Fullskjerm",
  "jump.more": "Mer",
  "jump.no_drawing": "Ingen strekfigur og ingen kurver: hoppet ble målt av en eldre versjon av svev. Mål det på nytt for å se dem.",

  "curves.title": "Kurver",
  "curves.all": "Alle kurver",
  "curves.about": "Tid og avstand regnes fra satsen. Båndet er ett standardavvik til hver side. Dra i en kurve for å flytte filmen.",
  "curves.not_in_sight": "hopperen er ikke i bildet",
  "curves.unsure": "usikkert her",
  "curves.speed": "Fart",
  "curves.height": "Bindingenes høyde",
  "curves.alpha": "Ski mot legg, α",
  "curves.beta": "Hofte, β",
  "curves.gamma": "V-vinkel, γ",
  "curves.dphi": "Høyre ski minus venstre, Δφ",
  "curves.phi": "Skienes helning, φ",
  "curves.angle_of_attack": "Angrepsvinkel",
};
