// The points of a LAS file as an independent reader has them (copc, by the authors of PDAL): one line each, x y z class
// sigma, with all digits.
//
// usage: node las_points.mjs FILE MODULES    MODULES: folder with node_modules/copc
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";

const [file, modules] = process.argv.slice(2);
const { Las } = createRequire(path.join(path.resolve(modules), "x"))("copc");
const data = fs.readFileSync(file);
const header = Las.Header.parse(data);
const records = await Las.Vlr.walk(async (begin, end) => new Uint8Array(data.subarray(begin, end)), header);
const extra = Las.Vlr.find(records, "LASF_Spec", 4);
const fields = extra ? Las.ExtraBytes.parse(data.subarray(extra.contentOffset, extra.contentOffset + extra.contentLength)) : [];
const view = Las.View.create(data.subarray(header.pointDataOffset), header, fields);
const columns = ["X", "Y", "Z", "Classification", ...fields.map((field) => field.name)].map((name) => view.getter(name));
const lines = Array.from({ length: header.pointCount }, (_, k) => columns.map((column) => column(k)).join(" "));
console.log(lines.join("\n"));
