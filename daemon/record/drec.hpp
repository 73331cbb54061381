// SPDX-License-Identifier: Apache-2.0
// The gateway's own record (docs/manual/record-format.md): entries, encoder, reader that survives damage.
#pragma once
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <driveid/time.h>

namespace gw {

inline constexpr char kDrecMagic[8] = {'D', 'R', 'V', 'I', 'D', 'R', 'E', 'C'};
inline constexpr uint32_t kDrecVersion = 1;
inline constexpr size_t kDrecEntryHeader = 24;
inline constexpr size_t kDrecPayloadMax = 65535;

enum class EntryKind : uint8_t { can_frame = 1, modbus_reply = 2, sample = 3, event = 4, mark = 5, estimate = 6 };

struct EntryHeader {
    uint32_t payload_len;
    EntryKind kind;
    uint8_t clock;
    uint16_t source;
    int64_t t_ns;
    uint32_t err_ns;
};

// Writes the 24 header bytes with the checksum over header and payload.
void drec_encode(const EntryHeader& header, const void* payload, uint8_t out[kDrecEntryHeader]);

// "DRVIDREC" version header_len header
std::string drec_file_header(const std::string& json);

struct RecordedSource {
    std::string name, kind, address;
};

class DrecReader {
public:
    // False with a sentence in error where this is no record. A damaged tail is no error.
    bool open(const std::string& path, std::string& error);
    // Next whole entry; false at the end. Damaged stretches are skipped and counted.
    bool next(EntryHeader& header, std::vector<uint8_t>& payload);
    const std::vector<RecordedSource>& sources() const { return sources_; }
    uint64_t damaged() const { return damaged_; }
    bool header_readable() const { return header_readable_; }  // else sources() is empty

    struct Closer { void operator()(FILE* f) const { if (f) fclose(f); } };

private:
    bool fill(size_t need);
    bool decode(EntryHeader& header, size_t& size);

    std::unique_ptr<FILE, Closer> file_;
    std::vector<RecordedSource> sources_;
    std::vector<uint8_t> buffer_;
    size_t begin_ = 0, end_ = 0;
    uint64_t damaged_ = 0;
    bool header_readable_ = false;
};

}  // namespace gw
