#pragma once
#include <components/communication_node/services.hpp>

#include <ise/core/result.hpp>
#include <ise/core/unique_function.hpp>
#include <ise/core/waiter.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace atirma {

/// Durable storage of a communication node: packets, telecommands, and the holder of the authority. A file
/// (`sqlite_store`) belongs to one node, and calls back before a call returns. A database (`postgres_store`) is shared
/// by all nodes of the boat, and calls back later, in a turn of the loop.
///
/// Data that a call reported as written survive a crash and a loss of power. Packets are numbered 1, 2, 3… in the order
/// in which they were kept. Used by one component, on its loop. Errors of all calls: io_failed, with the storage and
/// its message; malformed where a file is damaged. After the destructor nothing is called back.
class node_store {
public:
    template <class T>
    using then = ise::unique_function<void(ise::result<T>)>;

    virtual ~node_store() = default;

    virtual std::uint64_t number() const noexcept = 0;        ///< of this life of the store
    virtual std::uint64_t head() const noexcept = 0;          ///< position of the newest packet
    virtual std::uint64_t commands_head() const noexcept = 0; ///< position of the last change of a telecommand
    virtual std::string name() const = 0;                     ///< the file, or the database, for people

    /// What a node continues with.
    struct memory {
        std::vector<std::pair<std::uint8_t, utc_time>> newest; ///< of each kind, no later than its reception
        std::optional<telemetry_packet> last_location;         ///< the newest that is not history
        std::pair<authority_state, std::uint64_t> authority;   ///< and its number within the epoch
        std::vector<command_record> open_commands;
    };

    // Packets
    struct kept {
        std::uint64_t last = 0; ///< the highest position among them, also of those that were known
        std::uint32_t fresh = 0;
    };
    virtual void add(std::vector<telemetry_packet> packets, then<kept> done) = 0;
    virtual void packets(std::uint64_t after, std::uint64_t up_to, std::size_t most,
                         then<std::vector<telemetry_packet>> done) = 0;
    /// A page for somebody who knows what `request.seen` says; nothing beyond `up_to`.
    virtual void track(const track_request& request, std::uint64_t up_to, then<track_page> done) = 0;

    // Telecommands
    struct begun {
        std::optional<command_record> known; ///< its id is on record already; nothing was changed
        /// Another node changed the authority meanwhile; nothing was changed here.
        std::optional<std::pair<authority_state, std::uint64_t>> authority;
    };
    /// Records a new telecommand that was permitted under that epoch of the authority.
    virtual void begin(const command_record& record, std::uint32_t epoch, then<begun> done) = 0;
    virtual void put(std::vector<command_record> records, then<void> done) = 0;
    /// Whether the component with that path is another node that works with this store.
    virtual bool is_shared_with(const std::string&) const { return false; }
    virtual void command(std::uint32_t id, then<std::optional<command_record>> done) = 0;
    virtual void list(const record_request& request, then<record_page> done) = 0;

    // Authority
    /// Replaces the state that has the epoch of `before` and its number. Gives the present one if that is another.
    using change_of_authority = std::pair<authority_state, std::uint64_t>;
    virtual void put(const change_of_authority& state, const std::pair<std::uint32_t, std::uint64_t>& before,
                     then<std::optional<change_of_authority>> done) = 0;

    /// Removes what is too old, a few thousand rows at a time; how many it were.
    virtual void tend(std::uint64_t keep_packets, std::uint64_t keep_commands, then<std::int64_t> done) = 0;

    /// Changes that other nodes make to a database that they share.
    struct news {
        std::function<void()> packets;
        std::function<void(const std::vector<command_record>&)> commands;
        std::function<void(const change_of_authority&)> authority;
        std::function<void(const std::string& node)> node_lost; ///< a node was silent for `silence`
        std::function<void()> went_back;                        ///< it has another life: packets may be lost
        std::function<void(const ise::failure&)> lost;          ///< the database cannot be reached
    };
    virtual void follow(news) {}
};

/// A coroutine's wait for what a store calls back.
template <class T>
class store_answer {
public:
    explicit store_answer(ise::loop& on) : state_(std::make_shared<state>(on)) {}

    node_store::then<T> here() {
        return [to = std::weak_ptr(state_)](ise::result<T> came) {
            auto waiting = to.lock();
            if (!waiting) return; // the coroutine was cancelled
            waiting->came.emplace(std::move(came));
            waiting->wake.resume({});
        };
    }
    /// Cancellation: terminal; the store carries out what it was asked for.
    ise::task<ise::result<T>> get() {
        auto mine = state_;
        if (!mine->came) co_await mine->wake.wait();
        co_return std::move(*mine->came);
    }

private:
    struct state {
        explicit state(ise::loop& on) : wake(on) {}
        std::optional<ise::result<T>> came;
        ise::waiter<std::error_code> wake;
    };
    std::shared_ptr<state> state_;
};

} // namespace atirma
