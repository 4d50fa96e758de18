// What lies over the seafloor, drawn flat: track, vehicle, beam, measurements, scale bar and north.
import { roundStep } from "./map_store.js";
import { metres } from "./words.js";

const VEHICLE_PX = 15;

export class Overlay {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.scene = scene;
    this.context = canvas.getContext("2d");
  }

  resize(width, height, ratio) {
    this.width = width;
    this.height = height;
    this.ratio = ratio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
  }

  /** @param view { track, vehicle, fresh, tool, points, hover, marker, margins, aim, showTrack } */
  draw(view) {
    const c = this.context;
    const style = getComputedStyle(document.documentElement);
    this.ink = style.getPropertyValue("--ink").trim();
    this.halo = style.getPropertyValue("--halo").trim();
    this.accent = style.getPropertyValue("--accent").trim();
    this.vehicleColour = style.getPropertyValue("--vehicle").trim();
    this.trackColour = style.getPropertyValue("--track").trim();
    this.font = style.getPropertyValue("--font").trim();
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    c.clearRect(0, 0, this.width, this.height);
    this.free = view.margins;
    if (!this.scene.store) return;
    if (view.showTrack) this.#track(view.track);
    if (view.vehicle && !view.vehicle.silent) this.#beam(view);
    this.#points(view);
    if (view.vehicle) this.#vehicle(view.vehicle);
    if (view.aim) this.#aim();
    this.#furniture(view.margins);
  }

  #stroke(width, colour) {
    const c = this.context;
    c.lineJoin = c.lineCap = "round";
    c.strokeStyle = this.halo;
    c.lineWidth = width + 2.5;
    c.stroke();
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.stroke();
  }

  #track(track) {
    const c = this.context;
    const every = Math.max(1, Math.floor(track.length / 4 / 5000));
    c.beginPath();
    let down = false;
    for (let k = 0; k < track.length; k += 4) {
      const last = k + 4 >= track.length;
      if (!last && Number.isFinite(track[k]) && (k / 4) % every) continue;
      const at = Number.isFinite(track[k]) && this.scene.project({ northM: track[k], eastM: track[k + 1], downM: track[k + 2] });
      if (!at) {
        down = false;
        continue;
      }
      if (down) c.lineTo(at.x, at.y);
      else c.moveTo(at.x, at.y);
      down = true;
    }
    c.globalAlpha = 0.8;
    this.#stroke(1.2, this.trackColour);
    c.globalAlpha = 1;
  }

  /** The beam of now, or a fan's edges with what is between them; of a vehicle that says none, lines to the cells that
   * changed last; down to the bottom. */
  #beam({ vehicle, fresh }) {
    const c = this.context;
    const from = this.scene.project(vehicle);
    if (!from) return;
    const ends = vehicle.beams.map((beam) => this.scene.project(beam)).filter(Boolean);
    if (ends.length) {
      c.beginPath();
      c.moveTo(from.x, from.y);
      for (const to of ends) c.lineTo(to.x, to.y);
      c.closePath();
      c.fillStyle = this.vehicleColour;
      c.globalAlpha = 0.12;
      c.fill();
      c.globalAlpha = 1;
      this.#stroke(2, this.vehicleColour);
    }
    c.beginPath();
    for (const place of ends.length ? [] : fresh) {
      const to = this.scene.project(place);
      if (!to) continue;
      c.moveTo(from.x, from.y);
      c.lineTo(to.x, to.y);
    }
    c.strokeStyle = this.vehicleColour;
    c.globalAlpha = 0.35;
    c.lineWidth = 1;
    c.stroke();
    c.globalAlpha = 1;
    const below = this.scene.store.at(vehicle.northM, vehicle.eastM);
    if (below && !this.scene.mapView) {
      const to = this.scene.project({ ...vehicle, downM: below.depthM });
      if (to) {
        c.beginPath();
        c.moveTo(from.x, from.y);
        c.lineTo(to.x, to.y);
        c.setLineDash([5, 4]);
        this.#stroke(1.2, this.vehicleColour);
        c.setLineDash([]);
      }
    }
  }

  #vehicle(vehicle) {
    const c = this.context;
    const here = this.scene.project(vehicle);
    if (!here) return;
    const size = Math.max(VEHICLE_PX * this.scene.metresPerPixel(), 0.4);
    const yaw = (vehicle.headingDeg * Math.PI) / 180, pitch = (vehicle.pitchDeg * Math.PI) / 180, roll = (vehicle.rollDeg * Math.PI) / 180;
    const place = (ahead, right) => {
      const n = ahead * Math.cos(pitch) * Math.cos(yaw) - right * Math.cos(roll) * Math.sin(yaw);
      const e = ahead * Math.cos(pitch) * Math.sin(yaw) + right * Math.cos(roll) * Math.cos(yaw);
      const d = (-ahead * Math.sin(pitch) + right * Math.sin(roll)) / this.scene.shared.exaggeration.value;
      return this.scene.project({ northM: vehicle.northM + n * size, eastM: vehicle.eastM + e * size, downM: vehicle.downM + d * size });
    };
    const corners = [place(1, 0), place(-0.75, 0.68), place(-0.42, 0), place(-0.75, -0.68)];
    if (corners.some((p) => !p)) return;
    c.beginPath();
    corners.forEach((p, i) => (i ? c.lineTo(p.x, p.y) : c.moveTo(p.x, p.y)));
    c.closePath();
    this.#stroke(2, this.ink);
    c.fillStyle = vehicle.valid && !vehicle.silent ? this.vehicleColour : this.halo;
    c.fill();
    if (vehicle.silent) this.#label(`last heard ${vehicle.silent}`, here.x, here.y + 24);
    else if (!vehicle.valid) this.#label("last known position", here.x, here.y + 24);
    else if (vehicle.altitudeM !== null) this.#label(`${metres(vehicle.altitudeM, 1)} above the bottom`, here.x, here.y - 22);
  }

  #label(text, x, y) {
    const c = this.context;
    c.font = `600 12px ${this.font}`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    const half = c.measureText(text).width / 2 + 6;
    const middle = Math.max(Math.min(x, this.width - this.free.right - half - 4), this.free.left + half + 4);
    c.fillStyle = this.halo;
    c.beginPath();
    c.roundRect(middle - half, y - 10, 2 * half, 20, 5);
    c.fill();
    c.fillStyle = this.ink;
    c.fillText(text, middle, y + 0.5);
  }

  /** A place on the seafloor as it is drawn there. */
  #onGround(place) {
    return this.scene.project({ ...place, downM: this.scene.groundM(place) });
  }

  #points({ tool, points, hover, marker }) {
    const c = this.context;
    const all = tool !== "inspect" && hover && points.length ? [...points, hover] : points;
    if (tool !== "inspect" && all.length > 1) {
      c.beginPath();
      let down = false;
      const closed = tool === "area" && all.length > 2;
      const ring = closed ? [...all, all[0]] : all;
      for (let i = 0; i < ring.length; i++) {
        // On the ground between the points as well.
        const from = ring[Math.max(i - 1, 0)], parts = i ? 24 : 1;
        for (let k = 1; k <= parts; k++) {
          const t = k / parts;
          const at = this.#onGround({ northM: from.northM + (ring[i].northM - from.northM) * t, eastM: from.eastM + (ring[i].eastM - from.eastM) * t });
          if (!at) down = false;
          else {
            if (down) c.lineTo(at.x, at.y);
            else c.moveTo(at.x, at.y);
            down = true;
          }
        }
      }
      this.#stroke(2.5, this.accent);
    }
    points.forEach((place, i) => {
      const at = this.#onGround(place);
      if (!at) return;
      this.#dot(at, 5);
      if (tool === "profile" && points.length > 1) this.#label(i ? "B" : "A", at.x, at.y - 18);
    });
    if (marker) {
      const at = this.#onGround(marker);
      if (at) this.#dot(at, 4);
    }
  }

  #dot(at, radius) {
    const c = this.context;
    c.beginPath();
    c.arc(at.x, at.y, radius, 0, 7);
    c.fillStyle = this.accent;
    c.strokeStyle = this.halo;
    c.lineWidth = 2.5;
    c.fill();
    c.stroke();
  }

  #aim() {
    const c = this.context, { x, y } = this.middle;
    c.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      c.moveTo(x + 4 * dx, y + 4 * dy);
      c.lineTo(x + 13 * dx, y + 13 * dy);
    }
    this.#stroke(2, this.accent);
  }

  /** North, and on the map the scale: at the right edge of what is free. */
  #furniture(margins) {
    const c = this.context;
    const right = this.width - margins.right - 16, bottom = this.height - margins.bottom - 16;
    const north = this.scene.mapView ? 0 : Math.atan2(
      this.scene.perspective.position.x - this.scene.orbit.target.x, this.scene.perspective.position.z - this.scene.orbit.target.z);
    c.save();
    c.translate(right - 16, margins.top + 34);
    c.rotate(north);
    c.beginPath();
    c.moveTo(0, -18);
    c.lineTo(8, 12);
    c.lineTo(0, 6);
    c.lineTo(-8, 12);
    c.closePath();
    this.#stroke(1.5, this.ink);
    c.fillStyle = this.ink;
    c.fill();
    c.translate(0, -27);
    c.rotate(-north);
    c.font = `700 12px ${this.font}`;
    c.textAlign = "center";
    c.textBaseline = "middle";
    c.lineWidth = 3;
    c.strokeStyle = this.halo;
    c.strokeText("N", 0, 0);
    c.fillText("N", 0, 0);
    c.restore();
    if (!this.scene.mapView) return;
    const perPixel = this.scene.metresPerPixel();
    const length = roundStep(110 * perPixel), px = length / perPixel;
    c.beginPath();
    c.moveTo(right - px, bottom - 6);
    c.lineTo(right - px, bottom);
    c.lineTo(right, bottom);
    c.lineTo(right, bottom - 6);
    this.#stroke(2, this.ink);
    c.font = `600 12px ${this.font}`;
    c.textAlign = "center";
    c.textBaseline = "alphabetic";
    c.lineWidth = 3;
    c.strokeStyle = this.halo;
    const words = length >= 1000 ? `${length / 1000} km` : length >= 1 ? `${length} m` : `${Math.round(length * 100)} cm`;
    c.strokeText(words, right - px / 2, bottom - 10);
    c.fillStyle = this.ink;
    c.fillText(words, right - px / 2, bottom - 10);
  }
}
