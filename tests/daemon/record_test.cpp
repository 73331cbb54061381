// SPDX-License-Identifier: Apache-2.0
// The record: written bytes against the page docs/manual/record-format.md, damage survived, disk full survived.
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>
#include <sys/resource.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "base/crc32.hpp"
#include "record/record_writer.hpp"
#include "system/state.hpp"

using namespace gw;
namespace fs = std::filesystem;

namespace {

class Folder : public ::testing::Test {
protected:
    void SetUp() override {
        char name[] = "/tmp/driveid-record-XXXXXX";
        ASSERT_NE(mkdtemp(name), nullptr);
        path = name;
    }
    void TearDown() override { fs::remove_all(path); }
    std::string bytes(const std::string& file) {
        std::ifstream in(file, std::ios::binary);
        std::stringstream s;
        s << in.rdbuf();
        return s.str();
    }
    void put(const std::string& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }
    std::string path;
};
using Record = Folder;

TEST(Crc32, IsTheOneOfThePage) { EXPECT_EQ(crc32("123456789", 9), 0xCBF43926u); }

void write_some(const std::string& file, int n, uint64_t max_bytes = 1 << 20) {
    RecordWriter w(file, R"({"sources":[{"name":"can0","kind":"socketcan","address":"vcan0"}]})", 1 << 20, max_bytes);
    for (int k = 0; k < n; ++k) {
        const uint8_t payload[3] = {uint8_t(k), uint8_t(k >> 8), 7};
        w.write({3, EntryKind::mark, 2, 5, 1000 + k, 99}, payload);
    }
}

TEST_F(Record, BytesAreThoseOfThePage) {
    write_some(path + "/a.drec", 1);
    const std::string b = bytes(path + "/a.drec");
    ASSERT_EQ(b.substr(0, 8), "DRVIDREC");
    uint32_t version, header;
    memcpy(&version, b.data() + 8, 4);
    memcpy(&header, b.data() + 12, 4);
    EXPECT_EQ(version, 1u);
    ASSERT_EQ(b.size(), 16 + header + 24 + 3);
    EXPECT_EQ(b[16], '{');
    std::string entry = b.substr(16 + header);
    const uint8_t expected[20] = {3, 0, 0, 0, 5, 2, 5, 0, 0xE8, 3, 0, 0, 0, 0, 0, 0, 99, 0, 0, 0};
    EXPECT_EQ(memcmp(entry.data(), expected, 20), 0);
    uint32_t crc;
    memcpy(&crc, entry.data() + 20, 4);
    memset(entry.data() + 20, 0, 4);
    EXPECT_EQ(crc, crc32(entry.data(), entry.size()));
}

TEST_F(Record, ComesBackWhole) {
    write_some(path + "/a.drec", 1000);
    DrecReader r;
    std::string error;
    ASSERT_TRUE(r.open(path + "/a.drec", error)) << error;
    ASSERT_EQ(r.sources().size(), 1u);
    EXPECT_EQ(r.sources()[0].address, "vcan0");
    EntryHeader h;
    std::vector<uint8_t> p;
    for (int k = 0; k < 1000; ++k) {
        ASSERT_TRUE(r.next(h, p));
        EXPECT_EQ(h.t_ns, 1000 + k);
        EXPECT_EQ(h.err_ns, 99u);
        EXPECT_EQ(h.source, 5);
        ASSERT_EQ(p.size(), 3u);
        EXPECT_EQ(p[0] | p[1] << 8, k);
    }
    EXPECT_FALSE(r.next(h, p));
    EXPECT_EQ(r.damaged(), 0u);
}

TEST_F(Record, DamageCostsOnlyTheDamagedEntries) {
    write_some(path + "/a.drec", 1000);
    const std::string whole = bytes(path + "/a.drec");
    const size_t start = whole.size() - 1000 * 27;
    std::mt19937 random(5);
    for (int trial = 0; trial < 50; ++trial) {
        std::string b = whole.substr(0, whole.size() - random() % 500);
        const size_t kept = (b.size() - start) / 27;
        b[start + random() % (kept * 27)] ^= char(1 + random() % 255);
        put(path + "/b.drec", b);
        DrecReader r;
        std::string error;
        ASSERT_TRUE(r.open(path + "/b.drec", error));
        EntryHeader h;
        std::vector<uint8_t> p;
        size_t n = 0;
        while (r.next(h, p)) {
            ++n;
            ASSERT_EQ(h.t_ns - 1000, p[0] | p[1] << 8) << "an entry is right or not there";
        }
        EXPECT_EQ(n, kept - 1);
        EXPECT_GE(r.damaged(), 1u);
        EXPECT_LE(r.damaged(), 2u);
    }
}

TEST_F(Record, RefusesWhatIsNoRecord) {
    DrecReader r;
    std::string error;
    for (const std::string& text : {std::string(), std::string("DRVIDREC"), std::string(100, 'x'), std::string("DRVIDREC\2\0\0\0\0\0\0\0", 16), std::string("DRVIDREC\1\0\0\0\377\377\377\377", 16)}) {
        put(path + "/x.drec", text);
        EXPECT_FALSE(r.open(path + "/x.drec", error));
        EXPECT_NE(error.find("x.drec"), std::string::npos);
    }
    EXPECT_FALSE(r.open(path + "/none.drec", error));
}

TEST_F(Record, EndsAtItsLargestSize) {
    write_some(path + "/a.drec", 10000, 5000);
    EXPECT_LE(fs::file_size(path + "/a.drec"), 5000u);
}

TEST_F(Record, AFullDiskTearsNoEntryAndIsTold) {
    // A file-size limit stands in for a full disk: writes fall short, then fail.
    signal(SIGXFSZ, SIG_IGN);
    rlimit old;
    getrlimit(RLIMIT_FSIZE, &old);
    rlimit small{2000, old.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    uint64_t dropped = 0;
    int error = 0;
    {
        RecordWriter w(path + "/a.drec", "{}", 65536, 1 << 30);
        const std::vector<uint8_t> payload(100);
        for (int k = 0; k < 5000; ++k) w.write({100, EntryKind::mark, 2, 0, k, 0}, payload.data());
        for (int k = 0; k < 300 && !w.error(); ++k) usleep(10000);
        error = w.error();
        dropped = w.dropped();
    }
    setrlimit(RLIMIT_FSIZE, &old);
    EXPECT_EQ(error, EFBIG);
    EXPECT_GT(dropped, 4000u) << "what does not fit is counted";
    DrecReader r;
    std::string text;
    ASSERT_TRUE(r.open(path + "/a.drec", text)) << text;
    EntryHeader h;
    std::vector<uint8_t> p;
    while (r.next(h, p)) {}
    EXPECT_EQ(r.damaged(), 0u);
}

TEST(StateFile, OnlyAnUndamagedOneOpens) {
    const std::string json = R"({"a":1})";
    char head[64];
    snprintf(head, sizeof head, "driveid-state 1 %08x %zu\n", crc32(json.data(), json.size()), json.size());
    const std::string good = head + json;
    std::string_view inside;
    ASSERT_TRUE(state_open(good, inside));
    EXPECT_EQ(inside, json);
    for (size_t k = 0; k < good.size(); ++k) {
        EXPECT_FALSE(state_open(std::string_view(good).substr(0, k), inside)) << "cut at " << k;
        std::string bad = good;
        bad[k] ^= 0x11;
        EXPECT_FALSE(state_open(bad, inside)) << "changed at " << k;
    }
}

}  // namespace
