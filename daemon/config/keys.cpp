// SPDX-License-Identifier: Apache-2.0
#include "config/keys.hpp"

namespace gw {

namespace {

using C = ControlConfig;
using R = RecordConfig;
using S = SourceConfig;
using D = DriveConfig;
using F = FieldConfig;
using G = SignalConfig;
using K = SinkConfig;

const Key<Config> kTop[] = {
    {"format", &Config::format, "", 1, 1, "1", "", "version of this file's meaning", ""},
};

const Key<C> kControl[] = {
    {"socket", &C::socket, "", 0, 0, "/run/driveid/control.sock", "", "path of the control socket; \"\" for none", ""},
    {"mode", &C::mode, "", 0, 0, "0660", "", "octal permissions of the socket", ""},
    {"group", &C::group, "", 0, 0, "", "", "group that owns the socket; \"\" keeps the daemon's", ""},
    {"write_group", &C::write_group, "", 0, 0, "", "", "group whose members may use the writing commands; \"\" nobody", ""},
    {"clients", &C::clients, "", 1, 256, "16", "", "connections at the same time; further ones are refused", ""},
    {"queue_bytes", &C::queue_bytes, "byte", 65536, 1 << 26, "1048576", "", "events kept for a subscriber that does not read; then the oldest are lost", ""},
};

const Key<R> kRecord[] = {
    {"folder", &R::folder, "", 0, 0, ".", "", "folder of records", ""},
    {"file", &R::file, "", 0, 0, "", "", "record everything from the start into this file of the folder; \"\" no", ""},
    {"max_bytes", &R::max_bytes, "byte", 4096, kAny, "4294967296", "", "a record that reaches this size is closed", ""},
    {"buffer_bytes", &R::buffer_bytes, "byte", 65536, 1 << 30, "4194304", "", "memory between the bus and the disk; what does not fit is dropped and counted", ""},
};

const Key<StateConfig> kState[] = {
    {"folder", &StateConfig::folder, "", 0, 0, "", "", "folder where the last parameters survive a restart; \"\" none", ""},
    {"period_s", &StateConfig::period_s, "s", 0.1, 86400, "10", "", "time between two saves", ""},
};

const Key<SecurityConfig> kSecurity[] = {
    {"user", &SecurityConfig::user, "", 0, 0, "", "", "user to become once the sources are open (needs root at start); \"\" stays", ""},
    {"seccomp", &SecurityConfig::seccomp, "", 0, 0, "on", "on|off|log", "system-call filter: on kills what the daemon never does, log only reports it", ""},
};

const Key<SystemConfig> kSystem[] = {
    {"log_level", &SystemConfig::log_level, "", 0, 0, "info", "debug|info|warning|error", "least level that is logged", ""},
    {"metrics", &SystemConfig::metrics, "", 0, 0, "", "", "loopback port of the Prometheus text page, such as \"127.0.0.1:9464\"; \"\" none", ""},
    {"realtime_priority", &SystemConfig::realtime_priority, "", 0, 99, "0", "", "SCHED_FIFO priority; 0 ordinary scheduling", ""},
    {"lock_memory", &SystemConfig::lock_memory, "", 0, 0, "false", "", "mlockall at start", ""},
};

const Key<S> kSource[] = {
    {"name", &S::name, "", 0, 0, nullptr, "", "name that signals and sinks refer to", ""},
    {"kind", &S::kind, "", 0, 0, nullptr, "socketcan|modbus_tcp|modbus_rtu|slcan|replay|socketpair", "what it is", ""},
    {"interface", &S::interface, "", 0, 0, "", "", "CAN interface, such as \"can0\"", "socketcan"},
    {"fd", &S::fd, "", 0, 0, "false", "", "CAN FD frames too", "socketcan|socketpair"},
    {"buffer_bytes", &S::buffer_bytes, "byte", 2048, 1 << 30, "4194304", "", "receive buffer asked of the kernel; status says what was granted", "socketcan|socketpair"},
    {"descriptor", &S::descriptor, "", 0, 65535, "3", "", "inherited datagram socket that carries frames (tests)", "socketpair"},
    {"device", &S::device, "", 0, 0, "", "", "serial device, such as \"/dev/ttyACM0\"", "slcan|modbus_rtu"},
    {"baud", &S::baud, "bit/s", 300, 4000000, "115200", "", "speed of the serial line", "slcan|modbus_rtu"},
    {"parity", &S::parity, "", 0, 0, "even", "none|even|odd", "parity of the serial line", "modbus_rtu"},
    {"rs485", &S::rs485, "", 0, 0, "false", "", "switch the port to RS-485 mode", "modbus_rtu"},
    {"bitrate", &S::bitrate, "bit/s", 10000, 1000000, "500000", "", "speed of the CAN bus behind the adapter", "slcan"},
    {"host", &S::host, "", 0, 0, "127.0.0.1", "", "numeric address of the device", "modbus_tcp"},
    {"port", &S::port, "", 1, 65535, "502", "", "TCP port of the device", "modbus_tcp"},
    {"unit", &S::unit, "", 0, 247, "1", "", "Modbus unit", "modbus_tcp|modbus_rtu"},
    {"poll_s", &S::poll_s, "s", 0.0005, 3600, "0.01", "", "time between two polls", "modbus_tcp|modbus_rtu"},
    {"timeout_s", &S::timeout_s, "s", 0.005, 60, "0.3", "", "longest wait for a whole reply and for a connection", "modbus_tcp|modbus_rtu"},
    {"merge_gap", &S::merge_gap, "register", 0, 124, "8", "", "registers apart by no more than this are read in one request", "modbus_tcp|modbus_rtu"},
    {"file", &S::file, "", 0, 0, "", "", "record (.drec) or candump log (.log)", "replay"},
    {"recorded_source", &S::recorded_source, "", 0, 0, "", "", "which source of the record; \"\": the one of this name, else all", "replay"},
    {"speed", &S::speed, "", 0, 1e6, "1", "", "1 original pace, 10 ten times as fast, 0 as fast as possible", "replay"},
};

const Key<D> kDrive[] = {
    {"name", &D::name, "", 0, 0, nullptr, "", "name in status, records and sinks", ""},
    {"model", &D::model, "", 0, 0, "", "", "model file (TOML); instead of structure and given", ""},
    {"structure", &D::structure, "", 0, 0, "", "rigid_axis|linear_axis|two_mass_axis|dc_circuit|dc_drive|pmsm_drive|lti|", "known equations, where there is no model file", ""},
    {"method", &D::method, "", 0, 0, "fsm", "", "estimator: fsm, window, discrete, rls, kalman, adm (docs/methods.md); frequency: the sinusoids in one signal, without a structure", ""},
    {"type", &D::type, "", 0, 0, "f64", "f64|f32|q31", "number type of the estimator", ""},
    {"dt_s", &D::dt_s, "s", 1e-5, 60, nullptr, "", "nominal time between two samples; the true one comes from the stamps", ""},
    {"bandwidth_rad_s", &D::bandwidth_rad_s, "rad/s", 0, 1e6, "0", "", "bandwidth of the estimator's filters; 0 chosen from dt_s", ""},
    {"motion_rad_s", &D::motion_rad_s, "rad/s", 0, 1e6, "0", "", "instead of bandwidth_rad_s: the fastest motion to identify (resonance or corner); the filters are those that `driveid suggest` offers for it and dt_s", ""},
    {"forgetting_s", &D::forgetting_s, "s", 0, kAny, "0", "", "memory of the estimator; 0 its default (10 s), inf never forgets", ""},
    {"gap_s", &D::gap_s, "s", 0, 3600, "0", "", "a longer silence is a gap; 0: 5 dt_s", ""},
    {"paced", &D::paced, "", 0, 0, "false", "", "the drive samples every dt_s exactly and frames arrive late by a varying time (serial or USB adapter, busy sender): instants follow dt_s", ""},
    {"count_s", &D::count_s, "s", 0, 60, "0", "", "paced: time between two counts of [drive.counter], where that is not dt_s (Modbus polls that see only some of the counts)", ""},
    {"align_tolerance_s", &D::align_tolerance_s, "s", 0, 60, "0", "", "values of one sample arrive within this; 0: half of dt_s", ""},
    {"skew_s", &D::skew_s, "s", -1, 1, "0", "", "readings of currents, voltages and torque are older than their stamps by this, beside those of the motion: corrected; status shows it as estimated (at most 8 dt_s either way)", ""},
    {"sync", &D::sync, "", 0, 0, "", "", "signal whose arrival closes a sample; \"\": the sample closes when it is complete", ""},
    {"instant_can_id", &D::instant_can_id, "", -1, 0x7FF, "-1", "", "frame (CANopen SYNC: 0x80) whose arrival is the sampling instant of the values after it; -1 none", ""},
    {"report_s", &D::report_s, "s", 0.001, 3600, "0.1", "", "time between two estimates, in the time of the samples", ""},
    {"stale_s", &D::stale_s, "s", 0.001, 3600, "1", "", "silence after which parameters are no longer valid", ""},
    {"alarm", &D::alarm, "", -1, 1e6, "0", "", "residual alarm threshold of the estimator; 0 its default, negative: it never begins anew by itself", ""},
    {"speed_range", &D::speed_range, "rad/s, m/s", 0, 1e9, "0", "", "type q31: |speed| that the drive stays within, where the speed is no signal", ""},
    {"sinusoids", &D::sinusoids, "", 0, 2, "0", "", "method frequency: how many are looked for, 1 or 2; 0: 1", ""},
    {"highest_Hz", &D::highest_Hz, "Hz", 0, 1e5, "0", "", "method frequency: the highest frequency that is expected; the filters follow it, so twice as much as needed costs accuracy", ""},
    {"watch", &D::watch, "", 0, 0, "true", "", "run the loaded model beside the drive and say when it no longer explains it, and the likely effect", ""},
    {"record_samples", &D::record_samples, "", 0, 0, "true", "", "write decoded samples into the record, beside the frames", ""},
};

const Key<F> kField[] = {
    {"source", &F::source, "", 0, 0, nullptr, "", "name of the source", ""},
    {"can_id", &F::can_id, "", -1, 0x1FFFFFFF, "-1", "", "CAN identifier", ""},
    {"extended", &F::extended, "", 0, 0, "false", "", "29-bit identifier", ""},
    {"pgn", &F::pgn, "", -1, 0x3FFFF, "-1", "", "J1939 parameter group instead of can_id: any priority and sender", ""},
    {"start_bit", &F::start_bit, "bit", 0, 511, "0", "", "DBC numbering: least significant bit (little), most significant bit (big)", ""},
    {"length", &F::length, "bit", 1, 64, "16", "", "number of bits", ""},
    {"byte_order", &F::byte_order, "", 0, 0, "", "little|big|", "CAN: little (Intel, default) or big (Motorola). Modbus: big inside a register unless little", ""},
    {"encoding", &F::encoding, "", 0, 0, "", "i16|u16|i32|u32|i64|u64|f32|f64|", "Modbus: number in the registers (default u16). CAN: f32 or f64 for floating point", ""},
    {"signed", &F::is_signed, "", 0, 0, "false", "", "CAN: two's complement", ""},
    {"address", &F::address, "", -1, 65535, "-1", "", "Modbus: register address counted from 0", ""},
    {"registers", &F::registers, "", 0, 4, "0", "", "Modbus: number of registers; 0 by encoding", ""},
    {"table", &F::table, "", 0, 0, "input", "input|holding", "Modbus: which registers", ""},
    {"word_order", &F::word_order, "", 0, 0, "big", "big|little", "Modbus: which register comes first", ""},
    {"scale", &F::scale, "", -1e30, 1e30, "1", "", "value = raw * scale + offset, in the signal's SI unit", ""},
    {"offset", &F::offset, "", -1e30, 1e30, "0", "", "see scale", ""},
    {"counts_per_turn", &F::counts_per_turn, "count", 0, 1e15, "0", "", "encoder: replaces scale by 2 pi / counts_per_turn and unwraps; 0 no encoder", ""},
    {"gear_ratio", &F::gear_ratio, "", -1e6, 1e6, "1", "", "turns of the named axis for one turn of the encoder; negative where they turn against each other", ""},
    {"wrap_counts", &F::wrap_counts, "count", 0, 9e15, "0", "", "raw counter returns to its start after this many; 0: 2^length for an encoder, none for others", ""},
    {"min", &F::min, "", -kAny, kAny, "-inf", "", "a message whose value is below is rejected", ""},
    {"max", &F::max, "", -kAny, kAny, "inf", "", "a message whose value is above is rejected", ""},
    {"max_rate", &F::max_rate, "1/s", 0, kAny, "inf", "", "a faster change is a jump (encoder reset): counted, the angle goes on from its last value, a gap begins", ""},
};

const Key<F> kMux[] = {
    {"start_bit", &F::mux_start_bit, "bit", 0, 511, "0", "", "where the selector stands (DBC numbering)", ""},
    {"length", &F::mux_length, "bit", 1, 32, "8", "", "bits of the selector", ""},
    {"value", &F::mux_value, "", 0, 4294967295.0, nullptr, "", "the signal is there where the selector has this value", ""},
};

const Key<G> kSignal[] = {
    {"name", &G::name, "", 0, 0, nullptr, "", "signal: i_A i_d_A i_q_A v_V v_d_V v_q_V tau_Nm F_N theta_rad omega_rad_s theta_l_rad omega_l_rad_s x_m v_m_s T_degC u y", ""},
    {"hold", &G::hold, "", 0, 0, "", "instant|zoh|average|", "between two stamps: smooth, held, or a mean over the interval; \"\": what the structure assumes", ""},
    {"range", &G::range, "SI", 0, 1e12, "0", "", "type q31: |value| that the signal stays within; an angle may turn on and on, a position within one window may not", ""},
    {"wait", &G::wait, "", 0, 0, "true", "", "false: the last value is used and no sample waits for a new one (temperature)", ""},
    {"delay_s", &G::delay_s, "s", 0, 10, "0", "", "known age of the value when it is sent: taken off its stamp", ""},
};

const Key<K> kSink[] = {
    {"name", &K::name, "", 0, 0, nullptr, "", "name in status", ""},
    {"kind", &K::kind, "", 0, 0, nullptr, "can|modbus_server|record", "what it is", ""},
    {"source", &K::source, "", 0, 0, "", "", "CAN source on whose bus it sends", "can"},
    {"drive", &K::drive, "", 0, 0, "", "", "drive whose parameters it gives; modbus_server: \"\" all drives", "can|modbus_server"},
    {"can_id", &K::can_id, "", -1, 0x1FFFFFFF, "-1", "", "first identifier; one frame a parameter, counting up", "can"},
    {"extended", &K::extended, "", 0, 0, "false", "", "29-bit identifiers", "can"},
    {"period_s", &K::period_s, "s", 0.001, 3600, "0.1", "", "time between two rounds of frames", "can"},
    {"host", &K::host, "", 0, 0, "127.0.0.1", "", "address to listen on; loopback unless told otherwise", "modbus_server"},
    {"port", &K::port, "", 1, 65535, "1502", "", "TCP port to listen on", "modbus_server"},
    {"unit", &K::unit, "", 1, 247, "1", "", "unit it answers as", "modbus_server"},
    {"address", &K::address, "", 0, 65535, "0", "", "first input register", "modbus_server"},
    {"clients", &K::clients, "", 1, 64, "8", "", "connections at the same time", "modbus_server"},
    {"file", &K::file, "", 0, 0, "", "", "file below the record folder", "record"},
};

}  // namespace

std::span<const Key<Config>> top_keys() { return kTop; }
std::span<const Key<ControlConfig>> control_keys() { return kControl; }
std::span<const Key<RecordConfig>> record_keys() { return kRecord; }
std::span<const Key<StateConfig>> state_keys() { return kState; }
std::span<const Key<SecurityConfig>> security_keys() { return kSecurity; }
std::span<const Key<SystemConfig>> system_keys() { return kSystem; }
std::span<const Key<SourceConfig>> source_keys() { return kSource; }
std::span<const Key<DriveConfig>> drive_keys() { return kDrive; }
std::span<const Key<FieldConfig>> field_keys() { return kField; }
std::span<const Key<FieldConfig>> mux_keys() { return kMux; }
std::span<const Key<SignalConfig>> signal_keys() { return kSignal; }
std::span<const Key<SinkConfig>> sink_keys() { return kSink; }

}  // namespace gw
