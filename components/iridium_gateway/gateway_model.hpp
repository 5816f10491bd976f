#pragma once
#include <components/boat/random_source.hpp>
#include <components/iridium/message.hpp>
#include <components/iridium/rockblock.hpp>
#include <components/iridium_gateway/services.hpp>

#include <ise/core/time.hpp>

#include <deque>
#include <map>
#include <optional>
#include <set>

namespace atirma {

struct gateway_model_options {
    std::set<std::string> imeis; ///< of the account
    std::string username = "atirma";
    std::string password = "atirma";
    ise::duration min_repeat = std::chrono::seconds(2); ///< of a delivery that was not taken; doubles
    ise::duration max_repeat = std::chrono::minutes(15);
    ise::duration give_up = std::chrono::hours(12);
    ise::duration purge = std::chrono::hours(24 * 5); ///< messages that no modem fetched
    std::size_t max_queue = 50;                       ///< a modem
    std::size_t max_deliveries = 1000;                ///< MO messages under way; beyond it sessions fail: queue full
    iridium::estimate where{28.15, -15.45, 5};        ///< what it tells of the modem, with an error of its own
    bool tells_mtmsn = false;                         ///< RockBLOCK's posts do not; mail and DirectIP do
    std::uint64_t seed = 1;
};

/// The gateway without I/O: queues in both directions, what is delivered when and again, what a submission is answered.
/// Not thread safe.
class gateway_model {
public:
    explicit gateway_model(gateway_model_options options) : options_(std::move(options)), dice_(options_.seed) {}

    iridium_gateway_state state; ///< settings and counters

    /// Errors: refused, not_connected.
    ise::result<sbd_session_reply> session(ise::time_point now, std::chrono::sys_seconds wall,
                                           const sbd_session_request& request);

    struct delivery {
        std::uint64_t number = 0;
        iridium::mo_message message;
    };
    /// A delivery that is due; an outcome must follow. Several may be under way, also of one modem.
    std::optional<delivery> next_delivery(ise::time_point now);
    void on_delivered(ise::time_point now, std::uint64_t number, bool taken, const std::string& trouble);

    /// RockBLOCK's answer. `ring`: the modem to be alerted then.
    iridium::mt_reply submit(ise::time_point now, const iridium::mt_submission& what, std::string& ring);
    /// Queues a message by whichever way: its place (1…50), 0 for a flush without a message, or one of DirectIP's
    /// errors.
    struct queued {
        int status = 0;
        std::uint16_t mtmsn = 0;
    };
    queued enqueue(ise::time_point now, const std::string& imei, ise::bytes raw, bool flush);

    void flush(); ///< drops what waits for modems
    void on_time(ise::time_point now);
    ise::time_point next_event() const; ///< when next_delivery has something to do; max() if never

private:
    struct waiting_mo {
        iridium::mo_message message;
        ise::time_point since{}, next{};
        ise::duration pause{};
        bool under_way = false;
        bool again = false; // it was taken, and comes a second time
    };
    struct waiting_mt {
        std::uint16_t mtmsn = 0;
        ise::bytes raw;
        ise::time_point since{};
    };
    struct modem {
        std::deque<waiting_mt> queue;
        std::uint16_t handed_out = 0; // the first of the queue, not confirmed yet
    };

    gateway_model_options options_;
    random_source dice_;
    std::map<std::uint64_t, waiting_mo> deliveries_;
    std::map<std::string, modem> modems_;
    std::uint64_t next_number_ = 1;
    std::uint64_t next_reference_ = 4114651;
    std::uint32_t next_cdr_ = 1;
    std::uint16_t next_mtmsn_ = 1;
};

} // namespace atirma
