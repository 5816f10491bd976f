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

std::optional<failure> check_place(peer_channel& to, service_key service) {
    if (to.runtime().on().running_here()) return std::nullopt;
    return to.misplaced(service);
}

void start_call(peer_channel& to, std::shared_ptr<peer_channel>&& share, service_key service, duration deadline,
                const asio::any_io_executor& waiting, call_cancellation& cancellation, call_completion&& done,
                outgoing_packet request, const std::source_location& where) {
    to.call(std::move(share), service, deadline, waiting, cancellation, std::move(done), request, where);
}

} // namespace detail
} // namespace ise
