-- Wireshark dissector of Leadline's link (proto/SPEC.md): frames in UDP datagrams, messages of minor 1.
--
--   wireshark -X lua_script:host_tools/wireshark/leadline.lua
--   tshark -X lua_script:host_tools/wireshark/leadline.lua -r dive.pcap -d udp.port==9100,leadline -O leadline
--
-- Port 9100 is decoded without being asked. A frame that is no frame, or a payload that ends too early, is shown as
-- malformed; types of a newer minor by their number.

local leadline = Proto("leadline", "Leadline link")

local types = {
  [0x01] = "hello", [0x02] = "tile delta", [0x03] = "status", [0x04] = "text", [0x05] = "brief",
  [0x06] = "digest", [0x07] = "command answer", [0x08] = "slice", [0x09] = "coarse delta", [0x0A] = "question", [0x40] = "resend request", [0x41] = "hello request", [0x42] = "report",
  [0x43] = "digest request", [0x44] = "look", [0x45] = "command",
}
local kinds = {
  [1] = "start", [2] = "stop", [3] = "set", [4] = "origin", [5] = "save", [6] = "tiles", [7] = "slice",
}
local results = {
  [0] = "done", [1] = "not known", [2] = "out of range", [3] = "not with this configuration", [4] = "no position",
  [5] = "outside the grid", [6] = "busy", [7] = "interrupted",
}
local planes = { [0] = "horizontal", [1] = "down and north", [2] = "down and east" }
local severities = { [0] = "information", [1] = "warning", [2] = "error" }

local f = {
  frame_crc = ProtoField.uint32("leadline.crc", "CRC-32C", base.HEX),
  crc_good = ProtoField.bool("leadline.crc_good", "CRC is right"),
  type = ProtoField.uint8("leadline.type", "Type", base.HEX, types),
  tag = ProtoField.uint16("leadline.survey_tag", "Survey tag", base.HEX),
  major = ProtoField.uint8("leadline.hello.major", "Major"),
  minor = ProtoField.uint8("leadline.hello.minor", "Minor"),
  schema = ProtoField.uint32("leadline.hello.schema_hash", "Schema hash", base.HEX),
  survey = ProtoField.uint64("leadline.hello.survey_id", "Survey"),
  session = ProtoField.uint32("leadline.hello.session", "Session"),
  cell_mm = ProtoField.int32("leadline.hello.cell_mm", "Cell, mm"),
  size = ProtoField.int32("leadline.hello.size_cells", "Size, cells (north, east, down)"),
  origin = ProtoField.int64("leadline.hello.origin_mm", "Origin, mm (north, east, down)"),
  epsg = ProtoField.int32("leadline.hello.epsg", "EPSG"),
  name = ProtoField.string("leadline.hello.survey_name", "Survey's name"),
  datum = ProtoField.string("leadline.hello.vertical_datum", "Vertical datum"),
  link_rate = ProtoField.uint32("leadline.hello.link_rate_bytes_s", "Downlink's rate, bytes/s"),
  tile_count = ProtoField.uint8("leadline.delta.tile_count", "Tiles"),
  tile = ProtoField.uint32("leadline.tile", "Tile"),
  generation = ProtoField.uint32("leadline.delta.generation", "Generation"),
  hash32 = ProtoField.uint32("leadline.delta.hash32", "Hash", base.HEX),
  cells = ProtoField.uint32("leadline.delta.cell_count", "Cells"),
  body = ProtoField.bytes("leadline.delta.body", "Cells, range-coded"),
  t_us = ProtoField.int64("leadline.t_us", "Time, us"),
  t_ms = ProtoField.uint32("leadline.brief.t_ms", "Time, ms"),
  cycle = ProtoField.uint32("leadline.status.cycle", "Cycle"),
  alarms = ProtoField.uint32("leadline.alarms", "Alarms", base.HEX),
  validity = ProtoField.uint8("leadline.pose_validity", "Pose validity", base.HEX),
  position_mm = ProtoField.int32("leadline.status.position_mm", "Position, mm (north, east, down)"),
  position_cm = ProtoField.int32("leadline.brief.position_cm", "Position, cm (north, east, down)"),
  heading = ProtoField.uint16("leadline.heading", "Heading, 2^16 a turn"),
  tiles_known = ProtoField.uint32("leadline.tiles_known", "Tiles known"),
  tiles_dirty = ProtoField.uint32("leadline.tiles_dirty", "Tiles to be sent"),
  cells_sent = ProtoField.uint32("leadline.cells_sent", "Cells sent"),
  pings_fused = ProtoField.uint32("leadline.pings_fused", "Pings fused"),
  azimuth = ProtoField.uint8("leadline.swath.azimuth_bam8", "Beam's azimuth, 2^8 a turn"),
  depression = ProtoField.int8("leadline.swath.depression_bam8", "Beam's depression, 2^8 a turn"),
  range_dm = ProtoField.uint32("leadline.swath.range_dm", "Beam's range, dm"),
  severity = ProtoField.uint8("leadline.text.severity", "Severity", base.DEC, severities),
  text = ProtoField.string("leadline.text.text", "Text"),
  first = ProtoField.uint32("leadline.first", "First tile"),
  count = ProtoField.uint32("leadline.count", "Tiles"),
  log2 = ProtoField.uint8("leadline.digest.tiles_log2", "Tiles of a hash, log2"),
  digest_hash = ProtoField.uint32("leadline.digest.hash", "Hash", base.HEX),
  asked = ProtoField.bool("leadline.report.asked", "Answers a question", 8, nil, 0x80),
  mask_bytes = ProtoField.uint8("leadline.report.mask_bytes", "Bytes of the mask", base.DEC, nil, 0x7F),
  newest = ProtoField.uint16("leadline.newest", "Newest frame"),
  came = ProtoField.uint16("leadline.report.came", "Frame that came"),
  radius = ProtoField.uint8("leadline.look.radius_tiles", "Radius, tiles"),
  key_id = ProtoField.uint32("leadline.command.key_id", "Key", base.HEX),
  vehicle = ProtoField.uint16("leadline.command.vehicle", "Vehicle"),
  counter = ProtoField.uint64("leadline.command.counter", "Counter"),
  version = ProtoField.uint8("leadline.command.version", "Version"),
  kind = ProtoField.uint8("leadline.command.kind", "Kind", base.DEC, kinds),
  command_fields = ProtoField.bytes("leadline.command.fields", "Fields"),
  command_tag = ProtoField.bytes("leadline.command.tag", "Tag"),
  result = ProtoField.uint8("leadline.command.result", "Result", base.DEC, results),
  request = ProtoField.uint32("leadline.slice.request", "Request"),
  plane = ProtoField.uint8("leadline.slice.plane", "Plane", base.DEC, planes),
  slice_first = ProtoField.uint32("leadline.slice.first", "First cell (north, east, down)"),
  rows = ProtoField.uint8("leadline.slice.rows", "Rows"),
  columns = ProtoField.uint8("leadline.slice.columns", "Columns"),
  first_row = ProtoField.uint8("leadline.slice.first_row", "First row of this part"),
  row_count = ProtoField.uint8("leadline.slice.row_count", "Rows of this part"),
  runs = ProtoField.bytes("leadline.slice.runs", "Runs"),
}
local fields = {}
for _, field in pairs(f) do
  fields[#fields + 1] = field
end
leadline.fields = fields

local bad_frame = ProtoExpert.new("leadline.bad_frame", "Frame is damaged", expert.group.CHECKSUM, expert.severity.ERROR)
local bad_message = ProtoExpert.new("leadline.bad_message", "Message is cut or out of range", expert.group.MALFORMED, expert.severity.ERROR)
leadline.experts = { bad_frame, bad_message }

-- CRC-32C, reflected.
local crc_table = {}
for i = 0, 255 do
  local crc = i
  for _ = 1, 8 do
    if bit.band(crc, 1) == 1 then
      crc = bit.bxor(bit.rshift(crc, 1), 0x82F63B78)
    else
      crc = bit.rshift(crc, 1)
    end
  end
  crc_table[i] = crc
end

local function crc32c(bytes, count)
  local crc = bit.bnot(0)
  for i = 0, count - 1 do
    crc = bit.bxor(bit.rshift(crc, 8), crc_table[bit.band(bit.bxor(crc, bytes:get_index(i)), 0xFF)])
  end
  return bit.band(bit.bnot(crc), 0xFFFFFFFF) % 4294967296
end

-- COBS: a ByteArray, or nil.
local function unstuffed(range)
  local raw = range:bytes()
  local out = {}
  local at, size = 0, raw:len()
  while at < size do
    local code = raw:get_index(at)
    if code == 0 or at + code > size then
      return nil
    end
    for k = 1, code - 1 do
      out[#out + 1] = string.format("%02x", raw:get_index(at + k))
    end
    at = at + code
    if code < 0xFF and at < size then
      out[#out + 1] = "00"
    end
  end
  return ByteArray.new(table.concat(out))
end

-- Reads fields one behind the other; `ok` is false once one lay behind the end.
local Reader = {}
Reader.__index = Reader

local function reader(tvb, size)
  return setmetatable({ tvb = tvb, at = 0, size = size, ok = true }, Reader)
end

function Reader:take(count)
  if not self.ok or self.at + count > self.size then
    self.ok = false
    return nil
  end
  local range = self.tvb:range(self.at, count)
  self.at = self.at + count
  return range
end

function Reader:add(tree, field, count)
  local range = self:take(count)
  if range ~= nil then
    tree:add_le(field, range)
    return range
  end
end

function Reader:uint(tree, field, count)
  local range = self:add(tree, field, count)
  return range ~= nil and range:le_uint() or 0
end

-- value, range
function Reader:varint()
  local value, factor, begin = 0, 1, self.at
  for _ = 1, 5 do
    local byte = self:take(1)
    if byte == nil then
      return 0, nil
    end
    value = value + (byte:uint() % 128) * factor
    factor = factor * 128
    if byte:uint() < 128 then
      if value > 4294967295 then
        break
      end
      return value, self.tvb:range(begin, self.at - begin)
    end
  end
  self.ok = false
  return 0, nil
end

function Reader:add_varint(tree, field)
  local value, range = self:varint()
  if range ~= nil then
    tree:add(field, range, value)
  end
  return value
end

function Reader:add_text(tree, field, size)
  local text = self:take(size)
  if text ~= nil then
    tree:add(field, text, text:string(ENC_UTF_8))
    return text:string(ENC_UTF_8)
  end
end

local function unzigzag(code)
  if code % 2 == 1 then
    return -(code + 1) / 2
  end
  return code / 2
end

-- Not in a message of minor 0.
local function add_swath(read, tree)
  if not read.ok or read.at >= read.size then return end
  local count = read:take(1)
  for _ = 1, count and count:uint() or 0 do
    read:add(tree, f.azimuth, 1)
    read:add(tree, f.depression, 1)
    read:add_varint(tree, f.range_dm)
  end
end

local dissect = {}

dissect[0x01] = function(read, tree)
  if read:uint(tree, f.major, 1) ~= 1 then
    return "of another major version"
  end
  local minor = read:uint(tree, f.minor, 1)
  read:take(1)
  read:add(tree, f.schema, 4)
  local survey = read:add(tree, f.survey, 8)
  local session = read:uint(tree, f.session, 4)
  read:take(4)
  read:add(tree, f.cell_mm, 4)
  for _ = 1, 3 do read:add(tree, f.size, 4) end
  for _ = 1, 3 do read:add(tree, f.origin, 8) end
  read:take(17)
  read:add(tree, f.epsg, 4)
  local tables = read:take(1)
  if tables ~= nil then read:take(4 * tables:uint()) end
  if minor > 0 then
    for _, field in ipairs({f.name, f.datum}) do
      local size = read:take(1)
      if size ~= nil then read:add_text(tree, field, size:uint()) end
    end
    read:add(tree, f.link_rate, 4)
  end
  return survey and string.format("survey %s, session %d", tostring(survey:le_uint64()), session)
end

local function dissect_cells(read, tree, coarse)
  read:add(tree, f.tag, 2)
  local count = read:uint(tree, f.tile_count, 1)
  local tile, cells = 0, 0
  for _ = 1, count do
    local code, range = read:varint()
    if range == nil then return end
    tile = tile + unzigzag(code)
    local part = tree:add(f.tile, range, tile)
    read:add_varint(part, f.generation)
    if not coarse then
      read:add(part, f.hash32, 4)
    end
    local less = read:take(1)
    if less == nil then return end
    part:add(f.cells, less, less:uint() + 1)
    cells = cells + less:uint() + 1
  end
  if read.ok and read.at < read.size then
    read:add(tree, f.body, read.size - read.at)
  end
  return string.format("%d tiles, %d cells", count, cells)
end

dissect[0x02] = function(read, tree) return dissect_cells(read, tree, false) end
dissect[0x09] = function(read, tree) return dissect_cells(read, tree, true) end

dissect[0x03] = function(read, tree)
  read:add(tree, f.t_us, 8)
  read:add(tree, f.cycle, 4)
  read:add(tree, f.alarms, 4)
  read:take(8)
  read:add(tree, f.validity, 1)
  read:take(2)
  for _ = 1, 3 do read:add(tree, f.position_mm, 4) end
  read:take(4)
  read:add(tree, f.heading, 2)
  read:take(12)
  for _ = 1, 5 do read:varint() end
  read:add_varint(tree, f.pings_fused)
  for _ = 1, 18 do read:varint() end
  read:add_varint(tree, f.tiles_known)
  read:add_varint(tree, f.tiles_dirty)
  read:add_varint(tree, f.cells_sent)
  for _ = 1, 5 do read:varint() end
  local ports = read:take(1)
  for _ = 1, ports and ports:uint() or 0 do
    read:take(1)
    for _ = 1, 4 do read:varint() end
  end
  add_swath(read, tree)
end

dissect[0x04] = function(read, tree)
  read:add(tree, f.t_us, 8)
  read:add(tree, f.severity, 1)
  local size = read:take(1)
  return size and read:add_text(tree, f.text, size:uint())
end

dissect[0x05] = function(read, tree)
  read:add(tree, f.t_ms, 4)
  read:add_varint(tree, f.alarms)
  read:add(tree, f.validity, 1)
  for _ = 1, 3 do
    local code, range = read:varint()
    if range ~= nil then tree:add(f.position_cm, range, unzigzag(code)) end
  end
  read:add(tree, f.heading, 2)
  read:take(2)
  read:add_varint(tree, f.pings_fused)
  read:add_varint(tree, f.tiles_known)
  local dirty = read:add_varint(tree, f.tiles_dirty)
  read:add_varint(tree, f.cells_sent)
  add_swath(read, tree)
  return string.format("%d tiles to be sent", dirty)
end

dissect[0x06] = function(read, tree)
  read:add(tree, f.tag, 2)
  local first = read:add_varint(tree, f.first)
  read:add(tree, f.log2, 1)
  local count = read:take(1)
  for _ = 1, count and count:uint() or 0 do read:add(tree, f.digest_hash, 4) end
  return string.format("from tile %d, %d hashes", first, count and count:uint() or 0)
end

dissect[0x40] = function(read, tree)
  read:add(tree, f.tag, 2)
  local count = read:take(1)
  local tile, sum = 0, 0
  for _ = 1, count and count:uint() or 0 do
    local gap, range = read:varint()
    if range == nil then return end
    tree:add(f.first, range, tile + gap)
    local less, second = read:varint()
    if second == nil then return end
    tree:add(f.count, second, less + 1)
    tile = tile + gap + less + 2
    sum = sum + less + 1
  end
  return string.format("%d tiles", sum)
end

-- Minor 0 said no version.
dissect[0x41] = function(read, tree)
  if read.at >= read.size then return "" end
  local major = read:uint(tree, f.major, 1)
  local minor = read:uint(tree, f.minor, 1)
  return string.format("version %s.%s", major, minor)
end

dissect[0x42] = function(read, tree)
  read:add(tree, f.tag, 2)
  local reach = read:take(1)
  local newest = read:take(2)
  if newest == nil then return end
  tree:add(f.asked, reach)
  tree:add(f.mask_bytes, reach)
  tree:add_le(f.newest, newest)
  local frames = 0
  for at = 0, reach:uint() % 128 - 1 do
    local byte = read:take(1)
    if byte == nil then return end
    for bit = 0, 7 do
      if math.floor(byte:uint() / 2 ^ bit) % 2 == 1 then
        tree:add(f.came, byte, (newest:le_uint() - 8 * at - bit) % 65536)
        frames = frames + 1
      end
    end
  end
  return string.format("%d frames came%s", frames, reach:uint() >= 128 and ", asked" or "")
end

dissect[0x0A] = function(read, tree)
  read:add(tree, f.tag, 2)
  local newest = read:uint(tree, f.newest, 2)
  return string.format("up to frame %s", newest)
end

dissect[0x43] = function(read, tree)
  read:add(tree, f.tag, 2)
  local first = read:add_varint(tree, f.first)
  local less, range = read:varint()
  if range ~= nil then tree:add(f.count, range, less + 1) end
  return string.format("tiles %d .. %d", first, first + less)
end

dissect[0x44] = function(read, tree)
  read:add(tree, f.tag, 2)
  local tile = read:add_varint(tree, f.tile)
  read:add(tree, f.radius, 1)
  return string.format("at tile %d", tile)
end

dissect[0x07] = function(read, tree)
  read:add(tree, f.key_id, 4)
  local counter = read:add(tree, f.counter, 8)
  local result = read:uint(tree, f.result, 1)
  read:add(tree, f.command_tag, 8)
  return counter and string.format("command %s: %s", tostring(counter:le_uint64()), results[result] or "?")
end

dissect[0x08] = function(read, tree)
  read:add(tree, f.tag, 2)
  read:add(tree, f.request, 4)
  read:add(tree, f.plane, 1)
  for _ = 1, 3 do read:add_varint(tree, f.slice_first) end
  read:add(tree, f.rows, 1)
  read:add(tree, f.columns, 1)
  local first = read:uint(tree, f.first_row, 1)
  local count = read:uint(tree, f.row_count, 1)
  if read.ok and read.at < read.size then
    read:add(tree, f.runs, read.size - read.at)
  end
  return string.format("rows %d .. %d", first, first + count - 1)
end

dissect[0x45] = function(read, tree)
  if read:uint(tree, f.version, 1) ~= 1 then
    return "of another version"
  end
  read:add(tree, f.key_id, 4)
  read:add(tree, f.vehicle, 2)
  local counter = read:add(tree, f.counter, 8)
  local kind = read:uint(tree, f.kind, 1)
  if read.ok and read.size - read.at > 16 then
    read:add(tree, f.command_fields, read.size - read.at - 16)
  end
  read:add(tree, f.command_tag, 16)
  return counter and string.format("%s, number %s", kinds[kind] or "?", tostring(counter:le_uint64()))
end

local function take_frame(body, root, words)
  local raw = unstuffed(body)
  if raw == nil or raw:len() < 4 then
    root:add(leadline, body, "Leadline, no frame"):add_proto_expert_info(bad_frame)
    words[#words + 1] = "damaged"
    return
  end
  local size = raw:len() - 4
  local tvb = raw:tvb("Leadline payload")
  local stated = tvb:range(size, 4):le_uint()
  local crc = crc32c(raw, size)
  local tree = root:add(leadline, tvb:range(0, raw:len()), "Leadline")
  local good = crc == stated
  tree:add_le(f.frame_crc, tvb:range(size, 4))
  tree:add(f.crc_good, good):set_generated()
  if not good then
    tree:add_proto_expert_info(bad_frame)
    words[#words + 1] = "damaged"
    return
  end
  if size == 0 then
    words[#words + 1] = "empty"
    return
  end
  local read = reader(tvb, size)
  local type = read:uint(tree, f.type, 1)
  local name = types[type] or string.format("type %02x", type)
  local said = dissect[type] and dissect[type](read, tree)
  if not read.ok then
    tree:add_proto_expert_info(bad_message)
    said = "cut"
  end
  tree:append_text(", " .. name)
  words[#words + 1] = name .. (said and said ~= "" and " (" .. said .. ")" or "")
end

function leadline.dissector(buffer, pinfo, root)
  pinfo.cols.protocol = "Leadline"
  local words = {}
  local begin = 0
  for at = 0, buffer:len() - 1 do
    if buffer:range(at, 1):uint() == 0 then
      if at > begin then
        take_frame(buffer:range(begin, at - begin), root, words)
      end
      begin = at + 1
    end
  end
  if begin < buffer:len() then
    take_frame(buffer:range(begin), root, words)
  end
  pinfo.cols.info = table.concat(words, "; ")
  return buffer:len()
end

DissectorTable.get("udp.port"):add(9100, leadline)
