// SPDX-License-Identifier: Apache-2.0
#include "record/drec.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <nlohmann/json.hpp>

#include "base/crc32.hpp"

namespace gw {

namespace {

constexpr uint32_t kLongestHeader = 4u << 20;

template <class T>
void put(uint8_t* p, T v) {  // little-endian host, as everywhere the gateway runs
    memcpy(p, &v, sizeof v);
}
template <class T>
T get(const uint8_t* p) {
    T v;
    memcpy(&v, p, sizeof v);
    return v;
}

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);

// False where the text is no JSON object.
bool read_sources(const std::string& text, std::vector<RecordedSource>& out) {
    const auto json = nlohmann::json::parse(text, nullptr, false);
    if (!json.is_object()) return false;
    if (!json.contains("sources") || !json["sources"].is_array()) return true;
    for (const auto& s : json["sources"]) {
        const auto text_of = [&](const char* key) {
            return s.is_object() && s.contains(key) && s[key].is_string() ? s[key].get<std::string>() : std::string();
        };
        out.push_back({text_of("name"), text_of("kind"), text_of("address")});
    }
    return true;
}

}  // namespace

void drec_encode(const EntryHeader& h, const void* payload, uint8_t out[kDrecEntryHeader]) {
    put<uint32_t>(out, h.payload_len);
    out[4] = uint8_t(h.kind);
    out[5] = h.clock;
    put<uint16_t>(out + 6, h.source);
    put<int64_t>(out + 8, h.t_ns);
    put<uint32_t>(out + 16, h.err_ns);
    put<uint32_t>(out + 20, 0);
    put<uint32_t>(out + 20, crc32(payload, h.payload_len, crc32(out, kDrecEntryHeader)));
}

std::string drec_file_header(const std::string& json) {
    std::string out(kDrecMagic, 8);
    uint8_t numbers[8];
    put<uint32_t>(numbers, kDrecVersion);
    put<uint32_t>(numbers + 4, uint32_t(json.size()));
    out.append(reinterpret_cast<char*>(numbers), 8);
    return out + json;
}

bool DrecReader::open(const std::string& path, std::string& error) {
    file_.reset(fopen(path.c_str(), "rbe"));
    if (!file_) {
        error = path + ": " + strerror(errno) + "; check name and permissions";
        return false;
    }
    uint8_t head[16];
    if (fread(head, 1, 16, file_.get()) != 16 || memcmp(head, kDrecMagic, 8) != 0) {
        error = path + ": is no record of the gateway (.drec)";
        return false;
    }
    const uint32_t version = get<uint32_t>(head + 8), length = get<uint32_t>(head + 12);
    if (version != kDrecVersion) {
        error = path + ": has format " + std::to_string(version) + ", this version reads " + std::to_string(kDrecVersion);
        return false;
    }
    std::string json(std::min(length, kLongestHeader), '\0');
    if (length > kLongestHeader || fread(json.data(), 1, json.size(), file_.get()) != json.size()) {
        error = path + ": its header is damaged";
        return false;
    }
    header_readable_ = read_sources(json, sources_);
    buffer_.resize(4 * (kDrecEntryHeader + kDrecPayloadMax));
    begin_ = end_ = 0;
    return true;
}

bool DrecReader::fill(size_t need) {
    if (end_ - begin_ >= need) return true;
    memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    end_ += fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.get());
    return end_ - begin_ >= need;
}

// True where a whole entry with a right checksum begins at begin_.
bool DrecReader::decode(EntryHeader& h, size_t& size) {
    if (!fill(kDrecEntryHeader)) return false;
    const uint32_t length = get<uint32_t>(buffer_.data() + begin_);
    if (length > kDrecPayloadMax || !fill(kDrecEntryHeader + length)) return false;
    const uint8_t* p = buffer_.data() + begin_;
    uint8_t head[kDrecEntryHeader];
    memcpy(head, p, sizeof head);
    put<uint32_t>(head + 20, 0);
    if (crc32(p + kDrecEntryHeader, length, crc32(head, sizeof head)) != get<uint32_t>(p + 20)) return false;
    h = {length, EntryKind(p[4]), p[5], get<uint16_t>(p + 6), get<int64_t>(p + 8), get<uint32_t>(p + 16)};
    size = kDrecEntryHeader + length;
    return true;
}

bool DrecReader::next(EntryHeader& header, std::vector<uint8_t>& payload) {
    bool skipping = false;
    size_t size = 0;
    while (fill(1)) {
        if (decode(header, size)) {
            payload.assign(buffer_.begin() + long(begin_ + kDrecEntryHeader), buffer_.begin() + long(begin_ + size));
            begin_ += size;
            return true;
        }
        if (!skipping) ++damaged_;
        skipping = true;
        ++begin_;
    }
    return false;
}

}  // namespace gw
