#include <ise/service/remote.hpp>

#include <ise/service/peer_channel.hpp>

#include <asio/any_io_executor.hpp>

namespace ise {

const std::string& remote::name() const noexcept { return link_->name(); }
std::string remote::holder() const { return link_->holder(); }
task<result<void>> remote::connect(duration deadline) const {
    return link_->connect(saturating_add(link_->runtime().on().now(), deadline));
}

namespace detail {

std::shared_ptr<subscription_owner> subscriptions_of(std::shared_ptr<peer_channel> to) { return to; }

[[gnu::hot]] bool is_here(const peer_channel& to) { return to.runtime().on().running_here(); }
failure misplaced(const peer_channel& to, service_key service) { return to.misplaced(service); }

held<call_owner> keep(peer_channel& to) { return held<call_owner>(to); }

[[gnu::hot]] void start_call(peer_channel& to, service_key service, duration deadline,
                             const asio::any_io_executor& waiting, call_waiter& waiter, outgoing_packet request,
                             const std::source_location& where) {
    to.call(service, deadline, waiting, waiter, request, where);
}

} // namespace detail
} // namespace ise
