/**
 * Statements and refusals of the service by code: text, and advice. The English ones are in the service; a test checks
 * that every code is here. `{name}` is filled in from the values of the statement.
 *
 * @type {Record<string, [string, string?]>}
 */
export const statements = {
  state_idle: ["kameraene er av", "gjør riggen klar for å koble dem til"],
  state_arming: ["kobler til {cameras}"],
  state_disarming: ["kobler fra kameraene"],
  state_waiting: ["klar, venter på pulser"],
  state_waiting_partly: ["klar med {present} av {cameras} kameraer, venter på pulser: uten {missing}", "opptak går likevel; se på kameraet hva som må gjøres"],
  state_armed: ["klar, {rate_hz} pulser i sekundet"],
  state_armed_partly: ["klar med {present} av {cameras} kameraer: uten {missing}", "opptak går likevel; se på kameraet hva som må gjøres"],
  state_recording: ["tar opp"],
  state_recording_partly: ["tar opp med {present} av {cameras} kameraer: uten {missing}", "opptaket går likevel; se på kameraet hva som må gjøres"],

  fault_no_camera: ["ingen av kameraene svarer", "sjekk strøm og kabler; de kobles til av seg selv når de svarer"],
  fault_failed: ["{reason}", "det prøves igjen om {again_in_s} s; gjør klar for å prøve med en gang, slå av for å la være"],
  recording_continued: ["opptaket {recording} fortsetter i {log}: {reason}", "se etter disken før neste opptak"],
  recording_ended: ["opptaket {recording} tok slutt for tidlig: {reason}", "det som ble tatt opp til da, er tatt vare på; se hva opptaket sier"],
  process_restarted: ["{process} ble startet på nytt {restarts} ganger", "skjer det igjen, sjekk riggen"],

  camera_off: ["riggen er ikke gjort klar"],
  camera_connecting: ["kobler til {camera}"],
  camera_ready: ["{camera} er klar"],
  camera_silent: ["{camera} sender ingen bilder mens de andre gjør det", "sjekk triggerkabelen; kameraet kobles til på nytt av seg selv"],
  camera_absent: ["{camera} er borte", "sjekk strøm og kabel; kameraet kobles til på nytt av seg selv"],

  recording_running: ["tar opp: {pulses} pulser, {partial} mangler et bilde"],
  verdict_complete: ["Komplett: alle {pulses} pulser"],
  verdict_partial: ["{partial} av {pulses} pulser mangler et bilde"],
  verdict_empty: ["Det kom ingen puls", "Se på triggeren"],
  verdict_unfinished: ["Ble aldri avsluttet; {pulses} pulser kan leses", "svev recover lager en ordentlig logg av den"],
  verdict_damaged: ["Deler kan ikke leses eller mangler; {pulses} pulser kan leses", "Kjør svev verify på den"],
  verdict_trouble: ["Opptaket kan ikke leses", "Kjør svev verify på det"],

  state_forbids: ["det går ikke slik riggen står nå: se øverst hva den gjør, og hva som er neste steg"],
  unknown_recording: ["dette opptaket finnes ikke (lenger): se i listen og i papirkurven"],
  still_recording: ["opptaket er ikke ferdig: stopp det først"],
  storage: ["det kan ikke skrives på disken: sjekk plass og feste"],
  log_damaged: ["dette bildet kan ikke leses: kjør svev verify på opptaket"],
  process_died: ["en av prosessene døde: den startes på nytt; prøv igjen"],
  invalid_request: ["tjenesten godtar ikke det som ble skrevet: rett det"],
  bad_input: ["tjenesten godtar ikke det som ble skrevet: rett det"],
  bad_request: ["tjenesten forstår ikke kallet: last siden på nytt"],
  not_found: ["det finnes ikke (lenger): last siden på nytt"],
  method_not_allowed: ["tjenesten forstår ikke kallet: last siden på nytt"],
  unsupported_media_type: ["tjenesten forstår ikke kallet: last siden på nytt"],
  request_entity_too_large: ["for mye på én gang: skriv kortere"],
  request_head_too_large: ["for mye på én gang: slett nettleserens informasjonskapsler for denne siden"],
  request_timeout: ["kallet kom ikke fram i tide: sjekk forbindelsen, og prøv igjen"],
  range_not_satisfiable: ["filen er kortere enn det: last den ned på nytt"],
  unknown_camera: ["det finnes ikke noe kamera med dette navnet: last siden på nytt"],
  svev: ["det gikk ikke: se i loggen hva som skjedde, og prøv igjen"],
  internal_error: ["en feil i svev selv: prøv igjen; det som skjedde, står i tjenestens logg"],
  login_required: ["logg inn med nøkkelen"],
  wrong_token: ["nøkkelen er feil: ta den som tjenesten ble startet med"],
  too_many_wrong_tokens: ["for mange feil nøkler: vent litt, og prøv igjen"],
  too_many_viewers: ["for mange ser på allerede: lukk en av de andre sidene"],
  no_preview: ["det finnes ikke noe bilde: gjør riggen klar"],
  unknown_host: ["tjenesten kjenner ikke dette navnet på datamaskinen: bruk adressen den ble startet med"],
  foreign_origin: ["kallet kom fra en fremmed side: åpne panelet på dets egen adresse"],

  page_no_connection: ["ingen forbindelse med tjenesten: sjekk nettverket og tjenesten, og prøv igjen"],
  page_timeout: ["ikke noe svar i tide: se om det skjedde likevel, og prøv igjen"],
  page_strange: ["tjenesten svarer noe uventet: se i loggen dens"],
};
