-- What a script finds on the autopilot: the bindings that the shipped script calls and their near kin, over `host`.
-- A call of another one fails as it does there: an index of nil. Whatever the script must not touch is taken away.
local host = ...

local sethook, raise, kind, set_meta, whole = debug.sethook, error, type, setmetatable, math.floor
local try, pack, unpack, words_of, form = pcall, table.pack, table.unpack, tostring, string.format

-- uint32_t: a value of its own with the operators of the firmware's userdata.
local unsigned = {}
unsigned.__index = unsigned
unsigned.__metatable = "uint32_t"
local function number_of(value)
  if kind(value) == "table" then return value.bits end
  if kind(value) ~= "number" then raise("argument #1: uint32_t or number expected, got " .. kind(value), 3) end
  return whole(value)
end
local function make(value)
  return set_meta({ bits = value & 0xFFFFFFFF }, unsigned)
end
unsigned.__add = function(a, b) return make(number_of(a) + number_of(b)) end
unsigned.__sub = function(a, b) return make(number_of(a) - number_of(b)) end
unsigned.__mul = function(a, b) return make(number_of(a) * number_of(b)) end
unsigned.__div = function(a, b) return make(number_of(a) // number_of(b)) end
unsigned.__mod = function(a, b) return make(number_of(a) % number_of(b)) end
unsigned.__band = function(a, b) return make(number_of(a) & number_of(b)) end
unsigned.__bor = function(a, b) return make(number_of(a) | number_of(b)) end
unsigned.__eq = function(a, b) return number_of(a) == number_of(b) end
unsigned.__lt = function(a, b) return number_of(a) < number_of(b) end
unsigned.__le = function(a, b) return number_of(a) <= number_of(b) end
unsigned.__tostring = function(a) return form("%d", a.bits) end
-- Integers have 32 bits there, so half of the values are negative ones.
function unsigned:toint() return self.bits < 0x80000000 and self.bits or self.bits - 0x100000000 end
function unsigned:tofloat() return self.bits + 0.0 end

local function integer(value, place, low, high)
  if kind(value) == "table" and value.bits then value = value.bits end
  if kind(value) ~= "number" or whole(value) ~= value then
    raise("bad argument #" .. place .. " (integer expected)", 3)
  end
  if value < low or value > high then raise("bad argument #" .. place .. " (out of range)", 3) end
  return whole(value)
end
local function real(value, place)
  if kind(value) ~= "number" then raise("bad argument #" .. place .. " (number expected, got " .. kind(value) .. ")", 3) end
  return value + 0.0
end
local function text(value, place)
  if kind(value) ~= "string" then raise("bad argument #" .. place .. " (string expected, got " .. kind(value) .. ")", 3) end
  return value
end

mavlink = {}
function mavlink.init(_, queue, ids) host.mavlink_init(integer(queue, 1, 0, 255), integer(ids, 2, 0, 255)) end
function mavlink.register_rx_msgid(_, id) return host.register(integer(id, 1, 0, 16777215)) end
function mavlink.receive_chan()
  local bytes, link, at_ms = host.receive()
  if not bytes then return nil end
  return bytes, link, make(at_ms)
end

arming = {}
function arming.is_armed() return host.is_armed() end

vehicle = {}
function vehicle.get_mode() return host.get_mode() end
function vehicle.set_mode(_, mode) return host.set_mode(integer(mode, 1, 0, 255)) end

SRV_Channels = {}
function SRV_Channels.find_channel(_, wanted) return host.find_channel(integer(wanted, 1, -1, 300)) end
function SRV_Channels.set_output_pwm_chan_timeout(_, channel, pulse, timeout)
  host.override(integer(channel, 1, 0, 255), integer(pulse, 2, 0, 65535), integer(timeout, 3, 0, 65535))
end
function SRV_Channels.get_output_pwm(_, wanted) return host.get_output(integer(wanted, 1, -1, 300)) end

param = {}
function param.get(_, name) return host.get_param(text(name, 1)) end
function param.set(_, name, value) return host.set_param(text(name, 1), real(value, 2)) end
param.set_and_save = param.set
function param.add_table(_, key, prefix, count)
  return host.add_table(integer(key, 1, 0, 200), text(prefix, 2), integer(count, 3, 1, 63))
end
function param.add_param(_, key, index, name, value)
  return host.add_param(integer(key, 1, 0, 200), integer(index, 2, 1, 63), text(name, 3), real(value, 4))
end

local parameter = {}
parameter.__index = parameter
function parameter:init(name)
  if host.get_param(text(name, 1)) == nil then return false end
  self.name = name
  return true
end
function parameter:get() return self.name and host.get_param(self.name) end
function parameter:set(value) return self.name ~= nil and host.set_param(self.name, real(value, 1)) end
parameter.set_and_save = parameter.set
function Parameter(name)
  local made = set_meta({}, parameter)
  if name ~= nil and not made:init(name) then raise("No parameter: " .. name, 2) end
  return made
end

gcs = {}
function gcs.send_text(_, severity, words) host.send_text(integer(severity, 1, 0, 7), text(words, 2)) end
function gcs.send_named_float(_, name, value) host.send_float(text(name, 1), real(value, 2)) end

function millis() return make(host.millis()) end
function micros() return make(host.micros()) end
function uint32_t(value) return make(number_of(value)) end

debug, os, io, package, require, dofile, loadfile, load, collectgarbage, coroutine, python = nil
print = function(...) host.send_text(6, words_of((...))) end

-- Runs a function within so many instructions, and takes the time to nothing when they are used up: an error that the
-- script catches is raised again at the next instruction.
local function within(budget, work, ...)
  local function over()
    sethook(over, "", 1)
    raise("exceeded time limit", 0)
  end
  sethook(over, "", budget)
  local answers = pack(try(work, ...))
  sethook()
  return unpack(answers, 1, answers.n)
end
return within
