// Cyclone DDS: reliable topics that keep all, over UDP on the loopback (it has no better transport between processes
// here; where the table says tcp, this is udp). Calls are a topic for requests and one for replies.
#include "peers/peer.hpp"

#include "work.h"

#include <dds/dds.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <unistd.h>
#include <vector>

namespace {

using namespace bench;

dds_entity_t check(dds_entity_t made, const char* what) {
    if (made < 0) throw std::runtime_error(std::string(what) + ": " + dds_strretcode(-made));
    return made;
}

// Peers find each other by the loopback alone; write batching is its fast path for publications.
void configure(const options& asked) {
    std::string xml =
        "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" multicast=\"false\"/></Interfaces>"
        "<AllowMulticast>false</AllowMulticast><MaxMessageSize>65500B</MaxMessageSize></General>"
        "<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery>"
        "<Internal><Watermarks><WhcHigh>1MB</WhcHigh></Watermarks></Internal></Domain></CycloneDDS>";
    ::setenv("CYCLONEDDS_URI", xml.c_str(), 0);
    if (asked.work == "publish") dds_write_set_batch(true);
}

struct place {
    dds_entity_t participant, requests, replies;
};

place join(const std::string& unique) {
    place made{};
    made.participant = check(dds_create_participant(DDS_DOMAIN_DEFAULT, nullptr, nullptr), "participant");
    made.requests =
        check(dds_create_topic(made.participant, &work_packet_desc, ("requests_" + unique).c_str(), nullptr, nullptr),
              "topic");
    made.replies =
        check(dds_create_topic(made.participant, &work_packet_desc, ("replies_" + unique).c_str(), nullptr, nullptr),
              "topic");
    return made;
}

dds_qos_t* lossless() {
    auto* made = dds_create_qos();
    dds_qset_reliability(made, DDS_RELIABILITY_RELIABLE, DDS_SECS(10));
    dds_qset_history(made, DDS_HISTORY_KEEP_ALL, 0);
    return made;
}
dds_entity_t writer(const place& at, dds_entity_t topic) {
    return check(dds_create_writer(at.participant, topic, lossless(), nullptr), "writer");
}
dds_entity_t reader(const place& at, dds_entity_t topic) {
    return check(dds_create_reader(at.participant, topic, lossless(), nullptr), "reader");
}

struct sample {
    explicit sample(std::size_t bytes) : content(bytes, 'x') {
        packet.content._buffer = reinterpret_cast<std::uint8_t*>(content.data());
        packet.content._length = packet.content._maximum = static_cast<std::uint32_t>(bytes);
    }
    std::string content;
    work_packet packet{};
};

/// Waits for samples and gives each to `take`; at most `many` of them.
template <class Take>
std::uint64_t take_some(dds_entity_t waitset, dds_entity_t from, dds_duration_t patience, Take take) {
    constexpr int many = 64;
    void* samples[many] = {};
    dds_sample_info_t infos[many];
    auto got = dds_take(from, samples, infos, many, many);
    if (got == 0) {
        if (dds_waitset_wait(waitset, nullptr, 0, patience) <= 0) return 0;
        got = dds_take(from, samples, infos, many, many);
    }
    std::uint64_t valid = 0;
    for (int i = 0; i < got; ++i) {
        if (!infos[i].valid_data) continue;
        take(*static_cast<work_packet*>(samples[i]));
        ++valid;
    }
    if (got > 0) dds_return_loan(from, samples, got);
    return valid;
}

dds_entity_t watch(const place& at, const std::vector<dds_entity_t>& readers) {
    auto made = check(dds_create_waitset(at.participant), "waitset");
    for (auto one : readers) {
        dds_set_status_mask(one, DDS_DATA_AVAILABLE_STATUS);
        check(dds_waitset_attach(made, one, 0), "attach");
    }
    return made;
}

std::uint32_t matched(dds_entity_t one, bool writes) {
    if (writes) {
        dds_publication_matched_status_t status{};
        dds_get_publication_matched_status(one, &status);
        return status.current_count;
    }
    dds_subscription_matched_status_t status{};
    dds_get_subscription_matched_status(one, &status);
    return status.current_count;
}

void wait_for(dds_entity_t one, bool writes, std::uint32_t wanted) {
    while (matched(one, writes) < wanted) std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

void serve(const options& asked) {
    expect(asked, "cyclone", {"tcp"});
    configure(asked);
    const auto unique = std::to_string(::getpid());
    auto at = join(unique);
    auto out = writer(at, at.replies);
    sample one(asked.size_bytes);
    if (asked.work == "call") {
        auto in = reader(at, at.requests);
        auto waiting = watch(at, {in});
        announce(unique);
        for (;;)
            take_some(waiting, in, DDS_INFINITY,
                      [&](work_packet& request) { check(dds_write(out, &request), "write"); });
    }
    announce(unique);
    for (;;) {
        wait_for(out, true, static_cast<std::uint32_t>(asked.subscribers));
        if (asked.work == "paced") {
            once_a_millisecond(one.content, [&](const std::string& stamped) {
                std::memcpy(one.content.data(), stamped.data(), stamped.size());
                dds_write(out, &one.packet);
                return matched(out, true) != 0;
            });
        } else {
            while (matched(out, true) == asked.subscribers) {
                for (int i = 0; i != 1024; ++i) dds_write(out, &one.packet);
                dds_write_flush(out);
            }
        }
    }
}

outcome measure(const options& asked) {
    expect(asked, "cyclone", {"tcp"});
    configure(asked);
    auto at = join(asked.connect);
    if (asked.work == "call") {
        auto out = writer(at, at.requests);
        auto in = reader(at, at.replies);
        auto waiting = watch(at, {in});
        wait_for(out, true, 1);
        wait_for(in, false, 1);
        sample one(asked.size_bytes);
        const auto send = [&] { check(dds_write(out, &one.packet), "write"); };
        const auto receive = [&] { return take_some(waiting, in, DDS_SECS(5), [](work_packet&) {}); };
        if (asked.outstanding == 1) {
            return one_by_one(asked, [&] {
                send();
                if (receive() == 0) throw std::runtime_error("no reply for 5 s");
            });
        }
        for (std::size_t i = 0; i != asked.outstanding; ++i) send();
        return rate_by(asked, [&] {
            const auto got = receive();
            for (std::uint64_t i = 0; i != got; ++i) send();
            return got;
        });
    }
    std::vector<dds_entity_t> readers;
    for (std::size_t i = 0; i != asked.subscribers; ++i) readers.push_back(reader(at, at.replies));
    auto waiting = watch(at, readers);
    wait_for(readers.front(), false, 1);
    if (asked.work == "paced") {
        pace times(asked);
        while (!times.over())
            take_some(waiting, readers.front(), DDS_MSECS(100),
                      [&](work_packet& one) { times.take(one.content._buffer); });
        return times.result();
    }
    return rate_by(asked, [&] {
        std::uint64_t got = 0;
        for (auto one : readers)
            got += take_some(waiting, one, readers.size() == 1 ? DDS_MSECS(100) : 0, [](work_packet&) {});
        return got;
    });
}

} // namespace

int main(int argc, char** argv) { return peer_main(argc, argv, "cyclone", serve, measure); }
