#pragma once
#include <ise/naming/held_name.hpp>
#include <ise/naming/registrar.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/remote.hpp>
#include <ise/service/service_host.hpp>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace ise {

/// Keeps the names of a node by one lease at the name server, renewed at a third of it. Lives on the node's loop; its
/// coroutine belongs to the host's scope and ends with that.
///
/// The lease counts from when its renewal was sent, so that it is never over at the server while it is thought to hold
/// here. A node that could not renew goes on, its names unconfirmed. A server that does not know the lease is told
/// everything again, with the epochs that were granted. A name that was granted to somebody else meanwhile is given up:
/// `on_change` with errc::superseded.
///
/// A name that another holds is errc::name_taken only when its holder has been seen to live: that of a process which
/// died a moment ago is waited for until its lease is over.
class lease_registrar final : public registrar {
public:
    /// `name_servers`: they share a store; the next one is asked when one is lost, does not answer, or says that it
    /// cannot grant.
    lease_registrar(service_host& host, const std::vector<endpoint>& name_servers, duration lease);
    ~lease_registrar() override;

    task<result<std::uint64_t>> enroll(registration who, duration deadline) override;
    void update(registration who) override;
    void set_state(const std::string& path, std::uint64_t incarnation, std::string_view state) override;
    /// Completes when the server knows, or does not answer; then it is told as soon as it does.
    task<> withdraw(std::string path, std::uint64_t incarnation) override;

    task<> farewell() override;

    bool confirmed() const noexcept override;
    /// The epoch of a name, 0 if it was not granted.
    std::uint64_t epoch_of(const std::string& path) const noexcept;

private:
    struct departing {
        departing(loop& on, std::uint64_t life) : incarnation(life), over(on) {}
        std::uint64_t incarnation;
        waiter<> over; // for the one who withdrew it: the server knows, or does not answer, or it is their turn to tell
    };

    static task<> keep(lease_registrar& self);
    task<bool> tell();
    task<bool> renew();
    task<bool> tell_departures();
    held_name* find(const std::string& path, std::uint64_t incarnation) const noexcept;
    bool leaves(const std::string& path, std::uint64_t incarnation) const noexcept;
    void leave(const std::string& path, std::uint64_t incarnation);
    void forget_departure(const std::string& path);
    void end_of_telling();
    /// Keeps `to_tell_` true after a change of what the server is to be told of a name, or when.
    void line_up(held_name& name);
    void tell_again_all();
    bool due(time_point now) const { return !to_tell_.empty() && to_tell_.begin()->first.first <= now; }
    std::vector<held_name*> next_batch() const;
    std::unique_ptr<held_name> take_out(const std::string& path);
    naming::register_request request_of(const std::vector<held_name*>& batch) const;
    void take(naming::grant answer);
    void give_up(const std::string& path, failure why);
    void lease_granted(time_point sent_at, duration length);
    void look_at_lease(std::uint64_t server, std::uint64_t number);
    void lease_lost();
    void unreachable(const failure& why);
    time_point next_event() const;
    task<> pause_until(time_point at);
    void wake();

    service_host& host_;
    std::string servers_; // for people
    duration lease_;      // wanted, then as granted
    remote names_;
    std::uint64_t lease_key_;
    std::map<std::string, std::unique_ptr<held_name>> holdings_;
    std::map<held_name::place, held_name*> to_tell_; // of the holdings
    std::uint64_t lined_up_ = 0;                     // so often
    std::size_t batch_size_; // names told in one request; fewer over a slow link, lest the lease runs out meanwhile
    std::map<std::string, departing> departures_; // until the server has been told to forget them
    std::uint64_t departures_tried_ = 0;          // so often it was told of some
    std::uint64_t departures_failed_ = 0;         // the last of these that was not answered
    bool telling_departures_ = false;
    waiter<> told_departures_; // of some: for `farewell`
    time_point renew_at_ = time_point::max();
    std::atomic<time_point> valid_until_{time_point::min()};
    std::pair<std::uint64_t, std::uint64_t> lease_known_{}; // the server's incarnation, and its number there
    std::string obstacle_;                                  // why the server was not reached last
    bool complained_ = false;
    waiter<> news_;
    bool has_news_ = false;
};

} // namespace ise
