#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/function_ref.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/waiter.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/packet/shared_bytes.hpp>
#include <ise/session/contract.hpp>
#include <ise/subscription/subscriber_group.hpp>

#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

class remote_subscriber; // and what it takes to send: no user of a publication needs to know
class subscriber_line;
namespace wire {
struct subscribe;
struct subscribed;
} // namespace wire

/// One provided subscription service, without its types: numbers packets, keeps the last one, and gives each
/// subscriber what its policy says. A packet is encoded once, however many subscribe, and never where all of them are
/// in this process and know its type: they share it as it is.
class publication_core final : public subscriber_group, public std::enable_shared_from_this<publication_core> {
public:
    publication_core(service_runtime& runtime, std::string name, const packet_types& types);
    ~publication_core();

    const packet_types& types() const noexcept { return types_; }

    /// Whether a packet that can be shared as an object should be: somebody takes it so, or nobody takes anything. Who
    /// needs a frame gets it from the object.
    bool wants_object() const noexcept;
    /// Encodes a packet once for all subscribers, as a frame that is completed when it is published. It belongs to
    /// `trace`, if that is one.
    published_packet encoded(const trace_id& trace, function_ref<void(buffer&)> write_packet);
    /// The same of a packet that is encoded already.
    published_packet encoded(const trace_id& trace, bytes_view packet);
    /// A packet that is shared as it is.
    published_packet encoded(const trace_id& trace, shared_packet packet) { return {std::move(packet), trace}; }
    using choice = function_ref<bool(const subscriber_info&)>;
    /// Publishes to all subscribers; never blocks. With `chosen`: only to those with these numbers, which ascend; for
    /// the others it is skipped, which is no loss, and it is no last value.
    void publish(published_packet&& packet, const std::vector<std::uint64_t>* chosen = nullptr);
    /// The same for what `encoded` takes, to all.
    void publish(const trace_id& trace, function_ref<void(buffer&)> write_packet);
    void publish(const trace_id& trace, bytes_view packet);
    void publish(const trace_id& trace, shared_packet packet) { publish(encoded(trace, std::move(packet))); }
    /// To those for which `wants` returns true.
    void publish_to(published_packet packet, choice wants);
    /// Whether every lossless subscriber that is connected has room for one more packet.
    bool has_room() noexcept { return run_.packets_left > 0 || lossless == 0 || each_has_room(); }
    /// Waits until it has, or a subscriber has been silent for too long. Cancellation: terminal.
    task<> wait_for_room();
    /// The same, then publishes.
    static task<> send_when_room(std::shared_ptr<publication_core> to, published_packet packet);

    /// The longest packet that the subscriber of that number accepts now, as far as that is known.
    std::uint64_t longest_for(std::uint64_t number) const noexcept;

    std::size_t subscribers() const noexcept;
    std::uint64_t published() const noexcept { return sequence_; }
    /// Packets that wait to be sent, at all subscribers.
    std::size_t queued() noexcept;

    /// What functions of a publication that is none throw.
    [[noreturn]] static void throw_empty();

    /// Decides over a subscriber; gives the encoded response.
    using acceptor = std::function<result<bytes>(bytes_view request, const adapter* adapt, const subscriber_info&)>;
    using remover = std::function<bytes(bytes_view request, const adapter* adapt, const subscriber_info&)>;
    acceptor accept;
    remover removed;

    /// Ends all subscriptions: the service is withdrawn.
    void stop(const failure& why);
    /// The component stops: subscribers are let go without being told that it is over, so that they go on with
    /// the next life of the component.
    void let_go();

    // For sessions.
    /// Where it fails, `lost` is how many packets the subscriber has missed for good.
    result<remote_subscriber*> subscribe(subscriber_line& from, const wire::subscribe& terms, const adapter* adapt,
                                         bool takes_objects, wire::subscribed& answer, std::uint64_t& lost);
    bytes unsubscribe(remote_subscriber& who, bytes_view request, const adapter* adapt);
    /// It is told why, and is no subscriber any more.
    void end(remote_subscriber& who, const failure& why);

    // For its subscribers.
    shared_bytes frame_of(const shared_packet& object, std::uint64_t sequence, wall_time published_at,
                          const trace_id& trace) override;
    void use(large_memory_source& memory) noexcept override { maker_.use(memory); }
    void room_made() override;
    void began_to_linger(remote_subscriber& who) override;
    void stopped_lingering(remote_subscriber& who) noexcept override { std::erase(lingering_, &who); }
    void vanish(remote_subscriber& who) override;

private:
    bool each_has_room() noexcept;
    // Not inlined: it needs more registers than the usual path has to save.
    [[gnu::noinline]] void publish_behind(const trace_id& trace, bytes_view packet);
    void begin_run() noexcept;
    void end_run() noexcept override;
    result<remote_subscriber*> resume(remote_subscriber& who, const wire::subscribe& terms, bool takes_objects,
                                      wire::subscribed& answer, std::uint64_t& lost);
    failure cannot_resume(const wire::subscribe& terms, std::uint64_t& lost) const;
    [[noreturn]] void throw_too_large(std::size_t frame) const;
    void record_publication(trace_id& trace) const;
    void drop(remote_subscriber& who);
    subscriber_info take_out(remote_subscriber& who);
    void end_holding_up(time_point since);
    std::optional<published_packet> last_packet(bool as_object);
    void end_too_slow();

    const packet_types& types_;
    std::list<remote_subscriber*> lingering_; // oldest first; before them, who leave it when they go
    std::list<remote_subscriber> all_;
    shared_bytes_maker maker_;
    std::optional<published_packet> last_;
    std::uint64_t sequence_ = 0; // of the last packet published; the first has 1
    std::uint64_t next_number_ = 1;
    std::vector<waiter<>*> waiting_; // for room
    bool selective_ = false;         // packets were published for some only
    std::optional<failure> stopped_;
};

/// Where subscription services are looked up.
class publication_directory {
public:
    /// Null where there is none.
    virtual std::shared_ptr<publication_core> find_publication(std::string_view name) const = 0;
    /// Why there is none, for whoever subscribed to it.
    virtual failure no_publication(std::string_view name) const = 0;

protected:
    ~publication_directory() = default;
};

} // namespace ise
