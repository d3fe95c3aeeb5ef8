-- Wakewise: a companion computer drives each thruster of an ArduSub vehicle, while the pilot allows it.
--
-- SET_ACTUATOR_CONTROL_TARGET (139): controls[i] in -1..1 is motor i (SERVOn_FUNCTION 32 + i) at 1500 + 400 v us.
-- It acts only while all of this holds: WKW_ENABLE is 1; the vehicle is armed; its mode is one of WKW_MODES; the message
-- comes from this vehicle's own system id and component 191; its numbers are in range and there is one for each motor.
-- A message acts for 250 ms. Then, or at once when the vehicle is disarmed, switched off or put in another mode, the
-- outputs are the autopilot's again, that is, the pilot's. WKW_ENABLE is set to 0 at every start.
-- ALT_HOLD is handed back at the depth and heading of that moment: see step_out.
--
-- This Lua has 32-bit integers and 32-bit floats: nothing here needs more.

local VERSION = 2
local THRUST_MESSAGE = 139
local THRUST_BYTES = 43
local HEADER_BYTES = 12 -- mavlink_message_t: checksum 2, magic, length, flags 2, sequence, system, component, id 3
local MAVLINK_2 = 0xFD
local COMPANION = 191
local THRUST_GROUP, RELEASE_GROUP = 0, 1
local SLOTS = 8
local FIRST_FUNCTION = 33
local MIDDLE_US, FULL_US = 1500, 400
local HOLD_MS, LOOP_MS = 250, 20
local BACKSTOP_MS = 290 -- when an override ends by itself, should this script have stopped: HOLD_MS and two loops
local PAUSE_MS = 500
local MOST_AHEAD_US, MOST_BEHIND_US = 5000000, 250000
local RIVAL_MS = 1000
local STATE_MS = 500
local PARAMETER_TABLE = 87
local DEFAULT_MODES = 524293 -- 2^19 MANUAL + 2^2 ALT_HOLD + 2^0 STABILIZE
local STABILIZE, ALT_HOLD = 0, 2
local QUEUE = 10

local ACTING, OFF, DISARMED, MODE, SILENT, BAD_VALUE, BAD_SLOTS, TWO_SENDERS, STRANGER = 0, 1, 2, 3, 4, 5, 6, 7, 8
local CHANGED = 9
local WORDS = {
  [ACTING] = "acting",
  [OFF] = "not enabled",
  [DISARMED] = "disarmed",
  [MODE] = "mode not allowed",
  [SILENT] = "no thrusts arrive",
  [BAD_VALUE] = "thrusts refused: not a number or out of range",
  [BAD_SLOTS] = "thrusts refused: their slots are not the motors",
  [TWO_SENDERS] = "two senders",
  [STRANGER] = "thrusts refused: not from the companion",
  [CHANGED] = "mode changed, waits for a pause",
}
local INFO, WARNING = 6, 4

local function must(done, what)
  if not done then error("Wakewise: " .. what) end
end

must(param:add_table(PARAMETER_TABLE, "WKW_", 2), "parameter table " .. PARAMETER_TABLE .. " is another script's")
must(param:add_param(PARAMETER_TABLE, 1, "ENABLE", 0), "cannot add WKW_ENABLE")
must(param:add_param(PARAMETER_TABLE, 2, "MODES", DEFAULT_MODES), "cannot add WKW_MODES")
local enable, modes = Parameter(), Parameter()
must(enable:init("WKW_ENABLE") and modes:init("WKW_MODES"), "cannot read its parameters")
must(enable:set_and_save(0), "cannot switch itself off")

-- The order of these two arguments differs between the documentation and the code of some versions: one number.
mavlink:init(QUEUE, QUEUE)
mavlink:register_rx_msgid(THRUST_MESSAGE)

local own_system = nil
local acted_ms = nil -- when thrusts were last put on the motors; nil when none are on them
local acted_mode = nil -- the mode in which they were put there first
local stepped_out = false -- whether ALT_HOLD was left for a turn
local changed_ms = nil -- when the mode changed under thrusts, or the last message came since
local last_high, last_low = nil, nil -- time_usec of the last message in its turn: above and below 2^24 us
local last_ms = nil -- when that came
local rival_ms = nil -- when two senders were last noticed
local refused_ms, refused_why = nil, nil
local told_why, told_text, text_ms, state_ms = nil, nil, nil, nil

local function since(then_ms)
  return (millis() - then_ms):toint()
end

local function within(then_ms, limit_ms)
  return then_ms ~= nil and since(then_ms) < limit_ms
end

-- From 4.7 on SYSID_THISMAV is called MAV_SYSID.
local function system_id()
  return math.floor(param:get("MAV_SYSID") or param:get("SYSID_THISMAV") or 0)
end

local function mode_allowed()
  local mode = vehicle:get_mode()
  return mode >= 0 and mode < 24 and math.floor(modes:get() or 0) & (1 << mode) ~= 0
end

-- Why thrusts may not act now, whatever arrives; nil if they may.
local function closed()
  if enable:get() ~= 1 then return OFF end
  if not arming:is_armed() then return DISARMED end
  if not mode_allowed() then return MODE end
  if acted_ms ~= nil and vehicle:get_mode() ~= acted_mode then changed_ms = millis() end
  if within(changed_ms, PAUSE_MS) then return CHANGED end
  return nil
end

-- ALT_HOLD goes on beneath an override: it keeps the depth and heading of before, and adds up what it misses. ArduSub
-- takes the present ones only as it enters the mode, its sum from the throttle of before. So it is left for STABILIZE,
-- whose throttle is the stick's, and entered again in the next turn. The sticks act all the while.
local function step_out()
  if arming:is_armed() and vehicle:get_mode() == ALT_HOLD then stepped_out = vehicle:set_mode(STABILIZE) end
end

local function step_back()
  if not stepped_out then return end
  stepped_out = false
  if vehicle:get_mode() ~= STABILIZE then return end -- the pilot was quicker
  if not vehicle:set_mode(ALT_HOLD) then gcs:send_text(WARNING, "Wakewise: ALT_HOLD refused, now STABILIZE") end
end

-- Give the outputs back at once: an override of 0 ms ends one that runs.
local function release()
  if acted_ms == nil then return end
  step_out()
  for i = 0, SLOTS - 1 do
    local channel = SRV_Channels:find_channel(FIRST_FUNCTION + i)
    if channel then SRV_Channels:set_output_pwm_chan_timeout(channel, MIDDLE_US, 0) end
  end
  acted_ms, acted_mode = nil, nil
end

local function refuse(why)
  refused_ms, refused_why = millis(), why
end

-- Whether a message comes in its turn. One that was overtaken on its way, or came twice, is left out; clocks that are
-- further apart than that are two senders', and then nobody acts.
local function in_turn(high, low)
  if last_ms ~= nil and since(last_ms) < RIVAL_MS then
    local turns = high - last_high
    local ahead_us = nil
    if turns >= -1 and turns <= 1 then ahead_us = turns * 16777216 + low - last_low end
    if ahead_us == nil or ahead_us > MOST_AHEAD_US or ahead_us < -MOST_BEHIND_US then
      rival_ms = millis()
    elseif ahead_us <= 0 then
      return false
    end
  end
  last_high, last_low, last_ms = high, low, millis()
  if not within(rival_ms, RIVAL_MS) then return true end
  release()
  return false
end

-- Put values on the motors: all of them or none. A slot holds NaN exactly where there is no motor.
local function drive(payload)
  local channels, pulses = {}, {}
  for i = 0, SLOTS - 1 do
    local value = string.unpack("<f", payload, 9 + 4 * i)
    local channel = SRV_Channels:find_channel(FIRST_FUNCTION + i)
    if (value ~= value) ~= (channel == nil) then return BAD_SLOTS end
    if channel then
      if value < -1 or value > 1 then return BAD_VALUE end
      channels[#channels + 1] = channel
      pulses[#pulses + 1] = math.floor(MIDDLE_US + FULL_US * value + 0.5)
    end
  end
  for i = 1, #channels do
    SRV_Channels:set_output_pwm_chan_timeout(channels[i], pulses[i], BACKSTOP_MS)
  end
  acted_ms, acted_mode = millis(), acted_mode or vehicle:get_mode()
  return nil
end

local function take(bytes)
  if #bytes < HEADER_BYTES or bytes:byte(3) ~= MAVLINK_2 then return end
  local length, system, component = bytes:byte(4), bytes:byte(8), bytes:byte(9)
  if string.unpack("<I3", bytes, 10) ~= THRUST_MESSAGE then return end
  if system ~= own_system or component ~= COMPANION then
    refuse(STRANGER)
    return
  end
  -- What follows the length that was sent is not read: MAVLink 2 leaves zeros at the end out.
  local payload = bytes:sub(HEADER_BYTES + 1, HEADER_BYTES + math.min(length, THRUST_BYTES))
  payload = payload .. string.rep("\0", THRUST_BYTES - #payload)
  local group, target = payload:byte(41), payload:byte(42)
  if target ~= own_system and target ~= 0 then return end
  local low, high, top = string.unpack("<I3I3I2", payload)
  if top ~= 0 then
    refuse(BAD_VALUE)
    release()
    return
  end
  if not in_turn(high, low) or stepped_out then return end
  if group == RELEASE_GROUP then
    release()
    return
  end
  local fault = group ~= THRUST_GROUP and BAD_VALUE or drive(payload)
  if fault then
    refuse(fault)
    release()
  end
end

local function tell(why)
  if told_why ~= why or state_ms == nil or since(state_ms) >= STATE_MS then
    gcs:send_named_float("WKW_ENG", why == ACTING and 1 or 0)
    gcs:send_named_float("WKW_WHY", why)
    gcs:send_named_float("WKW_VER", VERSION)
    told_why, state_ms = why, millis()
  end
  -- A state that comes and goes is told at most as often as the figures above.
  if told_text ~= why and not within(text_ms, STATE_MS) then
    local loud = told_text == ACTING or why > SILENT
    gcs:send_text(loud and WARNING or INFO, "Wakewise: " .. WORDS[why])
    told_text, text_ms = why, millis()
  end
end

local function update()
  own_system = system_id()
  step_back()
  local why = closed()
  if why then release() end
  for _ = 1, QUEUE do
    local bytes = mavlink:receive_chan()
    if not bytes then break end
    if why == CHANGED then changed_ms = millis() end
    if not why then take(bytes) end
  end
  if why then
    last_ms, rival_ms, refused_ms = nil, nil, nil
  elseif within(rival_ms, RIVAL_MS) then
    why = TWO_SENDERS
  elseif within(acted_ms, HOLD_MS) then
    why = ACTING
  else
    release()
    why = within(refused_ms, RIVAL_MS) and refused_why or SILENT
  end
  tell(why)
  return update, LOOP_MS
end

gcs:send_text(INFO, "Wakewise: script " .. VERSION .. " loaded")
return update()
