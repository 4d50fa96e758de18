// Figures in words: what a pilot reads. Pure functions of the state message.

export function fixed(value, digits) {
  return value.toFixed(digits);
}

/** "1,234" */
export function grouped(value) {
  return Math.round(value).toLocaleString("en-GB");
}

export function metres(value, digits = 2) {
  return Math.abs(value) >= 1000 ? `${fixed(value / 1000, digits)} km` : `${fixed(value, digits)} m`;
}

/** "±": small ones in centimetres. */
export function sigma(valueM) {
  return valueM < 0.995 ? `${fixed(valueM * 100, valueM < 0.095 ? 1 : 0)} cm` : `${fixed(valueM, valueM < 10 ? 1 : 0)} m`;
}

/** "045°": which way from here to a place so far north and east. */
export function bearing(northM, eastM) {
  const degrees = Math.round((Math.atan2(eastM, northM) * 180) / Math.PI + 360) % 360;
  return `${String(degrees).padStart(3, "0")}°`;
}

export function squareMetres(value) {
  return value >= 1e6 ? `${fixed(value / 1e6, 2)} km²` : value >= 1e4 ? `${fixed(value / 1e4, 2)} ha` : `${fixed(value, 1)} m²`;
}

/** "4 s", "3 min 20 s", "2 h 5 min" */
export function duration(seconds) {
  const s = Math.max(Math.round(seconds), 0);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min${s % 60 ? ` ${s % 60} s` : ""}`;
  return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
}

/** "1:05", "1:02:03" */
export function clock(seconds) {
  const s = Math.max(Math.floor(seconds), 0);
  const two = (n) => String(n).padStart(2, "0");
  return s < 3600 ? `${Math.floor(s / 60)}:${two(s % 60)}` : `${Math.floor(s / 3600)}:${two(Math.floor((s % 3600) / 60))}:${two(s % 60)}`;
}

export function rate(bytesPerS) {
  return bytesPerS >= 10000 ? `${fixed(bytesPerS / 1000, 1)} kB/s` : `${grouped(bytesPerS)} B/s`;
}

/** Places of degrees from metres north and east of the origin (a plane that touches WGS 84 there). */
export function geodetic(map, northM, eastM) {
  if (map?.latitude_deg === undefined) return null;
  const phi = (map.latitude_deg * Math.PI) / 180;
  const a = 6378137, e2 = 0.00669437999014, w = Math.sqrt(1 - e2 * Math.sin(phi) ** 2);
  const meridian = (a * (1 - e2)) / w ** 3, transverse = (a / w) * Math.cos(phi);
  return { lat: map.latitude_deg + ((northM / meridian) * 180) / Math.PI,
           lon: map.longitude_deg + ((eastM / transverse) * 180) / Math.PI };
}

export function degrees(value, positive, negative) {
  return `${Math.abs(value).toFixed(6)}° ${value >= 0 ? positive : negative}`;
}

const SILENT_S = 10; // a slow link pauses for seconds; receive says so after the same time

export function silent(state) {
  return !state.player && !state.stored && state.link.silent_s >= SILENT_S;
}

/** Bytes come, and no whole frame any more: noise, or another rate. */
function noise(state) {
  return silent(state) && state.link.bytes_per_s > 0;
}

/** "14:03:20": when something was that is so many seconds ago. */
export function timeOfDay(agoS) {
  return new Date(Date.now() - agoS * 1000).toLocaleTimeString("en-GB");
}

/** "2026-11-30 14:29 UTC" */
export function dateTime(unixS) {
  return `${new Date(unixS * 1000).toISOString().slice(0, 16).replace("T", " ")} UTC`;
}

/** What stands over the figures while nobody renews them; null: somebody does. `link` as for stateWords. */
export function staleWords(state, link) {
  if (!link.connected) return "The monitor is not reached: figures are of the last moment";
  if (link.quietS) return "The monitor says nothing: figures are of its last word";
  if (!state || !silent(state)) return null;
  return `${noise(state) ? "Bytes come, but no whole frame" : "The vehicle has been silent"} since ${link.silentSince}: figures are of its last word`;
}

/** The state in a few words: { kind: "none" | "lost" | "bad" | "warn" | "ok" | "replay", words }.
 * @param link the page's own connection to the monitor: connected, quietS (nothing came for so long, 0: something does),
 *   silentSince (time of day of the vehicle's last frame) */
export function stateWords(state, link) {
  if (!link.connected) return { kind: "lost", words: "Monitor not reached" };
  if (link.quietS) return { kind: "lost", words: `Monitor silent for ${duration(link.quietS)}` };
  if (!state) return { kind: "none", words: "Connecting" };
  if (state.link.refused) return { kind: "bad", words: "Vehicle refused" };
  if (state.stored) return { kind: "replay", words: "Stored survey" };
  if (state.player) {
    const p = state.player;
    return { kind: "replay", words: p.seeking ? "Going there" : p.playing ? `Replay, ${p.speed} ×` : "Replay, paused" };
  }
  if (state.link.silent_s < 0) return { kind: "none", words: state.link.bytes ? "Bytes, but no frame" : "No link yet" };
  if (silent(state)) return { kind: "bad", words: `${noise(state) ? "Only noise" : "Vehicle silent"} for ${duration(state.link.silent_s)}` };
  if (!state.map) return { kind: "none", words: "Link heard, no hello yet" };
  if (state.vehicle?.mapping_paused) return { kind: "warn", words: "Mapping paused" };
  return state.vehicle?.alarms ? { kind: "warn", words: "Live, with alarms" } : { kind: "ok", words: "Live" };
}

/** What stands in the empty stage: null when there is a map. */
export function emptyWords(state, link) {
  if (!link.connected) {
    return ["The monitor is not reached", "The program ended, or this machine cannot reach it. The page tries again by itself."];
  }
  if (!state) return ["Connecting", ""];
  if (state.link.refused) return ["This vehicle is not understood", state.link.refused];
  if (state.stored) {
    return state.map.known_cells > 0 ? null : ["Nothing is stored yet", "This survey of the store has no cells."];
  }
  if (state.map) {
    return state.map.known_cells > 0 || state.map.coarse_tiles > 0 ? null
      : ["No seafloor yet", "The vehicle is heard; the first cells appear here as soon as they are sent."];
  }
  if (!state.link.bytes && !state.player) {
    return ["No link yet", `Waiting for a vehicle at ${state.link.uri}${state.link.port ? ` (${state.link.port})` : ""}.`];
  }
  if (state.link.frames === 0) {
    return ["Bytes, but no frame", `${grouped(state.link.bytes)} bytes came and none of them is Leadline's. Is it the right port, and the right rate?`];
  }
  return ["Link heard", "Waiting for the vehicle's hello, which explains its map."];
}

const REASONS = {
  shed: "queue full", no_return: "no return", range_too_short: "too near", range_too_long: "beyond range",
  pose_invalid: "pose invalid", too_far: "outside the grid", not_detected: "no bottom found",
  not_configured: "not configured", no_pose: "no pose", bad: "bad fields", paused: "mapping paused", stopped: "survey stopped",
};

function quality(link) {
  const all = link.frames_recent + link.damaged_recent;
  if (all === 0) return { level: "none", words: "nothing heard" };
  const share = link.damaged_recent / all;
  const percent = `${fixed(100 * share, share < 0.1 ? 1 : 0)} % damaged`;
  if (share === 0) return { level: "ok", words: "clean" };
  if (share < 0.02) return { level: "ok", words: `good, ${percent}` };
  if (share < 0.1) return { level: "warn", words: `fair, ${percent}` };
  return { level: "bad", words: `poor, ${percent}` };
}

/** Rows of the health panel: { id, label, words, level, share }. */
export function healthRows(state) {
  const rows = [];
  const add = (id, label, words, level = "ok", share = null, detail = "") => rows.push({ id, label, words, level, share, detail });
  const { link, map, vehicle, stored } = state;
  if (stored) {
    add("survey", "Survey", `no. ${stored.number}`, "ok", null, `${stored.path}, ${stored.kind === "merged" ? "merged from others" : "from a vehicle's link"}`);
    add("begun", "Begun", dateTime(stored.begun_unix_s));
    add("saved", "Last saved", dateTime(stored.saved_unix_s));
    if (stored.disputed_cells) {
      add("disputed", "Surveys disagree", `${grouped(stored.disputed_cells)} cells`, "warn", null, "checkered: the shallowest is shown");
    }
    if (stored.damaged_tiles) add("damaged", "Damaged on disk", `${grouped(stored.damaged_tiles)} tiles`, "bad", null, "left out");
  } else if (!state.player) {
    const q = quality(link);
    add("link", "Link", q.words, q.level);
    const budget = link.budget_bytes_per_s;
    add("rate", "Data rate", budget > 0 ? `${rate(link.bytes_per_s)} of ${rate(budget)}` : rate(link.bytes_per_s),
      budget > 0 && link.bytes_per_s > 1.05 * budget ? "warn" : "ok", budget > 0 ? link.bytes_per_s / budget : null);
  } else {
    add("rate", "Data rate", rate(link.bytes_per_s), "ok");
  }
  if (vehicle) {
    const pings = vehicle.pings;
    add("pings", "Pings mapped", `${fixed(vehicle.fused_per_s, vehicle.fused_per_s < 10 ? 1 : 0)} /s`,
      vehicle.mapping_paused ? "warn" : "ok", null, `${grouped(pings.fused)} in all`);
    const rejected = Object.keys(REASONS).filter((k) => k !== "shed" && pings[k] > 0).sort((a, b) => pings[b] - pings[a]);
    const sum = rejected.reduce((total, k) => total + pings[k], 0);
    add("shed", "Shed", pings.shed ? `${grouped(pings.shed)}, queue full` : "none", pings.shed ? "warn" : "ok");
    add("rejected", "Rejected", sum ? grouped(sum) : "none", "ok", null,
      rejected.slice(0, 4).map((k) => `${grouped(pings[k])} ${REASONS[k]}`).join(", "));
    const pose = vehicle.pose, horizontal = Math.max(pose.sigma_cm[0], pose.sigma_cm[1]);
    add("nav", "Navigation", pose.validity & 1 ? (horizontal >= 65535 ? "valid" : `± ${sigma(horizontal / 100)}`) : "no position",
      pose.validity & 1 ? (horizontal > 500 ? "warn" : "ok") : "bad", null,
      vehicle.nav.rejected ? `${grouped(vehicle.nav.rejected)} of ${grouped(vehicle.nav.fused + vehicle.nav.rejected)} fixes rejected` : "");
    const work = vehicle.work;
    if (work.bound > 0 && work.max > 0) {
      const percent = (voxels) => fixed((100 * voxels) / work.bound, voxels > 0 && 10 * voxels < work.bound ? 2 : 0);
      // The last cycle's own would jump: most cycles have no ping.
      add("work", "Work at most", `${percent(work.max)} % of bound`, work.max > work.bound ? "bad" : "ok", work.max / work.bound);
    }
    const closed = vehicle.ports.filter((port) => !port.open).length;
    if (vehicle.ports.length) {
      add("ports", "Devices", closed ? `${closed} of ${vehicle.ports.length} lost` : `${vehicle.ports.length} open`, closed ? "bad" : "ok");
    }
    if (vehicle.recorder_lost) add("recorder", "Recorder", `${grouped(vehicle.recorder_lost)} records lost`, "bad");
  }
  if (map) {
    add("map", "Map", `${grouped(map.known_cells)} cells`, "ok", null,
      `${metres(map.cell_mm / 1000)} each${vehicle && vehicle.tiles_dirty ? `, ${grouped(vehicle.tiles_dirty)} tiles still to come` : ""}`);
    if (map.coarse_tiles) {
      add("coarse", "Coarse so far", `${grouped(map.coarse_tiles)} tiles`, "ok", null, "hatched: cells four times as wide, until theirs come");
    }
    if (map.vertical_datum) add("datum", "Depths from", map.vertical_datum, "ok");
    if (map.incomplete_tiles) add("missing", "Lost on the way", `${grouped(map.incomplete_tiles)} tiles`, "warn", null, "asked for again");
  }
  return rows;
}
