/**
 * What the adjustment finds and why it refuses survey and images, by code. As in nb-statements.js.
 *
 * @type {Record<string, [string, string?]>}
 */
export const adjustment = {
  observed_image: ["punkt {point} i bilde {image}"],
  observed_control: ["det innmålte punktet {point}"],
  observed_distance: ["avstanden fra {start} til {end}"],
  observed_difference: ["forskjellen {axis} fra {start} til {end}"],

  blunder_needed: ["{what} er mistenkt{w}, men uten den finnes ikke noe resultat; mål på nytt"],
  blunder_one_of: ["en av disse observasjonene er feil{w}, men dataene kan ikke si hvilken: {which}; mål dem på nytt, eller legg til en observasjon"],
  blunder_sized: ["{what}: feil med omtrent ({size}) {unit}{w}; mål på nytt"],
  blunder_aside: ["{what}; resultatet bruker dem ikke"],
  blunder_tests: ["w for X, Y, Z {w}, redundanstall {r}"],

  exchanged_unseen: ["{first} ligger der innmålingen har {other}: {first} og {other} ser ut til å være byttet om; rett navnene"],
  exchanged_two: ["{names} og {last} ser ut til å være byttet om: hver ligger der innmålingen har den andre; rett navnene"],
  exchanged_more: ["{names} og {last} ser ut til å være byttet om: hver ligger der innmålingen har den neste; rett navnene"],

  refused_points: ["innmålingen motsier bildene: {gone} av {count} innmålte punkter måtte vekk ({names}); sjekk navn, koordinater og enheter, og mål dem inn på nytt"],
  refused_survey: ["innmålingen motsier bildene: lagt på de {count} innmålte punktene har blokken sigma0 {ratio} (a priori 1); sjekk navn, enheter og sigmaer i innmålingen, de indre orienteringene, og om to kameraer er byttet om"],
  refused_mirrored: ["innmålingen er speilvendt: den passer til bildene når en akse snus; X, Y, Z må være høyrehendt, så bytt om to akser, eller fortegnet på en"],
  refused_sigma0: ["sigma0 er {ratio} ganger den a priori, verken ved en tilfeldighet (opptil {high}) eller fordi sigmaer er bedømt feil; navn, enheter eller indre orienteringer er feil: rett dem, og bruk ikke dette resultatet"],
  refused_exchanged_poses: ["bildene {one} og {other} ser ut til å være byttet om: hvert ble funnet der det andre er oppgitt; bytt om målingene, eller plasseringene hvis det er de som er feil"],
  refused_exchanged_cameras: ["bildene {one} og {other} ser ut til å være byttet om: når hvert får det andres kamera, er sigma0 {least} ganger den a priori, og {before} ganger slik de er; bytt om målingene eller kameraene"],
  refused_units: ["bildene ble funnet {factor} ganger så langt fra hverandre som de oppgitte plasseringene er: innmåling og plasseringer har hver sin enhet; oppgi begge i den samme"],

  unconverged_iterations: ["ikke noe optimum etter {most} iterasjoner; oppgi bedre startverdier, eller bestem færre kameraparametre"],
  unconverged_start: ["startverdiene har ingen bilder (et punkt i et projeksjonssenter); oppgi bedre"],
  unconverged_step: ["ikke noe steg gjør restfeilene mindre lenger; oppgi bedre startverdier"],
  unconverged_bounds: ["tallene går over alle grenser; sjekk enheter og sigmaer, eller oppgi startverdier"],
  unconverged_digits: ["løsningen har mistet sifrene sine (redundanstallene går ikke opp); se etter koordinater eller sigmaer som er helt ute av forhold"],
  unconverged_wrong: ["ikke noe optimum, fordi noe er grovt feil: {what}"],
  unconverged_ties: ["{error}; knytepunkter uten plass, utelat dem: {words}"],

  left_out_image: ["ikke orientert: {why}"],
  left_out_point: ["punkt {point} er utelatt: {why}"],

  named_image: ["bilde {name}"],
  named_images: ["bildene {names}"],
  named_point: ["punkt {name}"],
  named_points: ["punktene {names}"],
  named_more: ["{names} og {more} til"],

  free_position: ["posisjonen"],
  free_rotation: ["dreiningen"],
  free_scale: ["målestokken"],
  free_several: ["{part} ({count})"],

  defect_sigmas: ["sigmaene ligger {orders} størrelsesordener fra hverandre i det de betyr, og avrunding skjuler det som de minst nøyaktige observasjonene bestemmer; oppgi sigmaer så store som feilene er"],
  defect_camera_unseen: ["kamera {camera} har ingen observasjoner: {names} er ubestemt; bestem ikke noe av det"],
  defect_camera: ["kamera {camera}: {names} kan ikke skilles fra hverandre ({size} ubestemt); bestem færre av dem, eller gi dem en sigma"],
  defect_images_unseen: ["{which} uten observasjoner ({size} ubestemt): observer punkter, eller utelat dem"],
  defect_pose: ["bilde {image}: {count} observerte punkter bestemmer ikke plasseringen ({size} ubestemt); observer flere punkter i det, eller utelat det"],
  defect_no_ray: ["uten observasjoner: legg til minst to stråler, eller utelat dem"],
  defect_one_ray: ["med én stråle bare, så dybden er åpen: observer dem i et bilde til, eller utelat dem"],
  defect_parallel_rays: ["med parallelle stråler: observer dem fra et annet sted, eller utelat dem"],
  defect_points: ["{which} {why} ({size} ubestemt)"],
  defect_datum: ['uten datum: ingenting holder fast {parts} av nettet ({size} ubestemt); legg til innmålte punkter eller en avstand, eller ta "datum": {"type": "inner"}'],
  defect_datum_points: ["{which} bestemmer ikke datum ({missing} betingelser mangler); velg minst tre som ikke ligger på en linje"],
  defect_datum_line: ["punktene som bestemmer datum, faller på en linje ({missing} betingelser mangler); velg andre"],
  defect_parts: ["nettet faller i {parts} deler som ingenting binder sammen ({size} ubestemt), den minste er {which}; observer felles punkter"],
  defect_interior: ["{names} kan ikke skilles fra plasseringene og punktene ({size} ubestemt); ta bilder som er dreid 90 grader og fra andre avstander, bestem færre parametre, eller gi dem en sigma"],
  defect_joint: ["{which} bestemmes ikke sammen ({size} ubestemt); legg til observasjoner"],
  defect_singular: ["ved optimum er nettet singulært så langt tallene rekker; bestem færre kameraparametre"],
  defect_weak_place: ["bilde {image} er knapt bestemt: restfeilene tillater plasseringer lenger fra X0 {place} enn fem av dens sigma ({sigma}); mål inn punkter lenger fra hverandre eller utenfor planet deres, kom nærmere, eller oppgi en omtrentlig plassering"],
  defect_two_poses: ["bilde {image} har {count} plasseringer som restfeilene ikke avgjør mellom, fordi de innmålte punktene nesten ligger i et plan: X0 {places} med vTPv {sums}; mål inn et punkt utenfor det planet, kom nærmere, eller oppgi en omtrentlig plassering"],
  defect_three_points: ["bilde {image} viser bare tre punkter, som passer like godt til {count} plasseringer: X0 {places}; mål et fjerde punkt i det, eller oppgi en omtrentlig plassering"],
};
