#include <ise/service/remote.hpp>

#include <ise/service/peer_channel.hpp>

#include <asio/post.hpp>
#include <asio/system_executor.hpp>

#include <fmt/format.h>

namespace ise {

const std::string& remote::name() const noexcept { return link_->name(); }
std::string remote::holder() const { return link_->holder(); }
task<result<void>> remote::connect(duration deadline) const {
    return link_->connect(saturating_add(link_->runtime().on().now(), deadline));
}

namespace detail {

std::shared_ptr<subscription_owner> subscriptions_of(std::shared_ptr<peer_channel> to) { return to; }

namespace {

failure misplaced(peer_channel& to, service_key service) {
    return {errc::invalid_argument,
            fmt::format("'{}' at {} was used off its component's thread: spawn the call on that component "
                        "(component::spawn), or wait for it from another thread (component::wait)",
                        service.name, to.name())};
}

template <class Link>
void start(Link&& to, service_key service, duration deadline, const asio::any_io_executor& waiting,
           call_cancellation& cancellation, call_completion done, outgoing_packet request,
           const std::source_location& where) {
    if (!to->runtime().on().running_here()) [[unlikely]] {
        auto why = misplaced(*to, service);
        auto completion = done(call_outcome{&why, nullptr});
        if (waiting) asio::post(waiting, std::move(completion));
        else asio::post(asio::system_executor(), std::move(completion));
        return;
    }
    auto& way = *to;
    auto& on = way.runtime().on();
    auto& call = way.calls().open(call_owner::hold(std::forward<Link>(to)), cancellation);
    call.service.assign(service.name);
    call.types = service.types;
    call.deadline =
        saturating_add(on.now(), deadline > duration{} ? deadline : way.runtime().options().default_deadline);
    call.trace = {};
    call.made_in = context_of(waiting ? waiting : on.get_executor());
    if (call.made_in) {
        call.deadline = std::min(call.deadline, call.made_in->deadline);
        call.trace = call.made_in->trace;
    }
    call.began = on.now();
    call.where = where;
    if (auto* traces = way.runtime().options().traces.get()) [[unlikely]]
        call.spans = traces->begin_call(call.trace, call.caused_by, call.made_in != nullptr);
    call.done = std::move(done);
    way.submit(call, request);
}

} // namespace

std::optional<failure> check_place(peer_channel& to, service_key service) {
    if (to.runtime().on().running_here()) return std::nullopt;
    return misplaced(to, service);
}

void start_call(const std::shared_ptr<peer_channel>& to, service_key service, duration deadline,
                const asio::any_io_executor& waiting, call_cancellation& cancellation, call_completion done,
                outgoing_packet request, const std::source_location& where) {
    start(to, service, deadline, waiting, cancellation, std::move(done), request, where);
}

void start_call(std::shared_ptr<peer_channel>&& to, service_key service, duration deadline,
                const asio::any_io_executor& waiting, call_cancellation& cancellation, call_completion done,
                outgoing_packet request, const std::source_location& where) {
    start(std::move(to), service, deadline, waiting, cancellation, std::move(done), request, where);
}

} // namespace detail
} // namespace ise
