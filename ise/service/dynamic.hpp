#pragma once
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/service/remote.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// Calls and subscriptions of services whose packets are known at run time only, as a component describes them.
/// <ise/component/provide_dynamic.hpp> provides such services.
namespace ise {

/// A service with the schemas that were received for it. A value, cheap to copy.
class dynamic_contract {
public:
    /// errc::invalid_argument unless there are as many packets as the kind has (two, or five).
    static result<dynamic_contract> make(std::string name, service_kind kind, std::vector<schema> packets);
    /// From the canonical texts of its packets, also from untrusted sources, such as a file. Fails as `make` and
    /// `schema::parse` do, with the packet that is wrong.
    static result<dynamic_contract> parse(std::string name, service_kind kind,
                                          const std::vector<std::string>& schema_texts);
    /// Of a service that is known at compile time: `dynamic_contract::of(position)`.
    template <class Contract>
    static dynamic_contract of(const Contract& service) {
        return dynamic_contract(std::string(service.name()), std::make_shared<const packet_types>(Contract::types()));
    }

    /// The name of the service.
    const std::string& name() const noexcept { return name_; }
    /// Request-response or subscription.
    service_kind kind() const noexcept { return types_->kind; }
    /// By its `role`: `packet(role::request)`.
    const schema& packet(std::size_t place) const noexcept { return types_->schemas[place]; }
    /// All of its schemas.
    const std::shared_ptr<const packet_types>& types() const noexcept { return types_; }

private:
    dynamic_contract(std::string name, std::shared_ptr<const packet_types> types)
        : name_(std::move(name)), types_(std::move(types)) {}

    std::string name_;
    std::shared_ptr<const packet_types> types_;
};

/// A packet of this schema with the defaults of all fields. Throws errc::type_mismatch for a schema that is no struct,
/// and errc::too_large for defaults that exceed `decode_limits`: a schema of a peer may be either.
dynamic_packet default_packet(const schema& of);

/// Calls and waits for the response, at most `deadline` (zero: the component's default). The failures are those of
/// `remote::try_call`, errc::invalid_argument for a subscription, and errc::type_mismatch if `request` does
/// not match the service. A request of another schema is adapted.
/// On the loop of the component that made `provider`. Cancellation: terminal; the provider's handler is cancelled too.
task<result<dynamic_packet>> call_dynamic(remote provider, dynamic_contract service, dynamic_packet request,
                                          duration deadline = duration());

/// A live subscription of packets known at run time; see `subscriber`.
class dynamic_stream {
public:
    dynamic_stream() = default;
    /// Takes the subscription over.
    dynamic_stream(dynamic_stream&&) noexcept = default;
    /// The same; a subscription that was held before is ended.
    dynamic_stream& operator=(dynamic_stream&& other) noexcept;
    ~dynamic_stream();

    /// Waits for the next packet; empty when the subscription has ended (`cause()` says why). Cancellation: terminal,
    /// no packet is lost.
    task<received<dynamic_packet>> next();
    /// A packet that has already arrived, or an empty one. Never suspends.
    received<dynamic_packet> try_next();

    /// The provider's response to the subscription.
    const dynamic_packet& response() const noexcept;
    /// Counts of received and lost packets so far.
    const subscription_counts& counts() const noexcept;
    /// Whether the provider is connected now; false while the connection is being restored.
    bool connected() const noexcept;
    /// Whether it has ended: `next()` returns the remaining packets, then empty ones.
    bool ended() const noexcept;
    /// Only where `ended()`.
    const failure& cause() const noexcept;
    /// Ends it now; a waiting `next()` returns an empty packet. The provider gets a default unsubscribe packet.
    void unsubscribe();
    /// The same with an unsubscribe packet, which is adapted to the service: returns the provider's response. See
    /// `subscriber::leave`, also for the errors, and errc::invalid_argument for a packet that does not fit.
    /// Cancellation: terminal; the subscription has ended.
    task<result<dynamic_packet>> unsubscribe(dynamic_packet request, duration deadline = duration());

    class core;
    /// Made by `subscribe_dynamic`.
    explicit dynamic_stream(std::shared_ptr<core> made) noexcept;

private:
    std::shared_ptr<core> core_;
};

/// Subscribes with a subscribe packet; completes when the provider has committed. The failures are those of
/// `remote::subscribe`, and errc::invalid_argument for a request-response service.
/// The stream continues to adapt packets to `service` when the provider restarts with compatible packets.
/// Cancellation: terminal, unsubscribes.
task<result<dynamic_stream>> subscribe_dynamic(remote provider, dynamic_contract service, dynamic_packet request,
                                               subscribe_options options = subscribe_options());
/// The same with the defaults of the subscribe packet. Fails also where it has none; see `default_packet`.
/// Cancellation: terminal, unsubscribes.
task<result<dynamic_stream>> subscribe_dynamic(remote provider, dynamic_contract service,
                                               subscribe_options options = subscribe_options());

/// A run of an action whose packets are known at run time only; see `action_run`.
class dynamic_run {
public:
    dynamic_run() = default;
    dynamic_run(dynamic_run&&) noexcept = default; ///< takes the run over
    /// The same; a run that was held before is cancelled.
    dynamic_run& operator=(dynamic_run&& other) noexcept;
    ~dynamic_run();

    /// Waits for the next report of progress; empty when the run is over. Throws errc::malformed for one that is not
    /// readable. Cancellation: terminal; the run goes on.
    task<std::optional<dynamic_packet>> next();
    /// Waits for the end of the run; the failures are those of `action_run::result`. Cancellation: terminal; the run
    /// goes on.
    task<result<dynamic_packet>> outcome();
    /// Cancels the run now.
    void cancel();
    /// How many goals the provider executes before it.
    std::uint32_t queue_position() const;

    /// Made by `start_dynamic`.
    dynamic_run(std::shared_ptr<run_core> core, action_schemas types);

private:
    std::shared_ptr<run_core> core_;
    action_schemas types_;
};

/// Starts a run of an action with a goal, which is adapted to the service; completes when the provider has accepted it.
/// The failures are those of `remote::start`, and errc::invalid_argument for a service that is no action.
/// Cancellation: terminal, cancels the run.
task<result<dynamic_run>> start_dynamic(remote provider, dynamic_contract service, dynamic_packet goal,
                                        run_options options = run_options());

} // namespace ise
