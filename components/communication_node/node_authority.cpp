#include <components/communication_node/node_authority.hpp>

#include <fmt/format.h>

namespace atirma {

node_authority::node_authority(node_context& here, store_keeper& store, other_node& peer, const opened_store& opened,
                               std::function<void()> changed_hands)
    : here_(here), store_(store), peer_(peer), changed_hands_(std::move(changed_hands)), book_(here.options.secondary),
      authorities_(here.self.publish(services::authority_changes)) {
    set(opened.known.authority.first, opened.known.authority.second);
}

void node_authority::set(const authority_state& state, std::uint64_t change) {
    book_.apply(state, change);
    authorities_(book_.now());
    if (!unconfirmed_ || state.epoch < *unconfirmed_) return;
    if (state.epoch == *std::exchange(unconfirmed_, std::nullopt)) changed_hands_();
}

void node_authority::restore(const authority_state& state, std::uint64_t change) {
    if (!book_.is_newer(state, change)) return;
    (void)store_.written(store_.file().put(state, change)); // it is in memory, and the store's trouble is reported
    set(state, change);
}

void node_authority::begin_anew() {
    if (now().epoch != 0) (void)store_.written(store_.file().put(now(), book_.change()));
}

ise::task<authority_state> node_authority::change(authority_request request, std::string who) {
    for (;;) {
        auto made = book_.decide(request, who, here_.clock());
        if (!made) throw ise::error(made.error());
        bool hands = made->epoch != now().epoch;
        if (!hands && made->asked_by == now().asked_by) break;
        node_store::change_of_authority next(*made, hands ? std::uint64_t{0} : book_.change() + 1);
        std::pair before(now().epoch, book_.change());
        store_answer<std::optional<node_store::change_of_authority>> answer(here_.self.on());
        store_->put(next, before, store_.written(answer.here()));
        auto put = co_await answer.get();
        if (!put && put.error().executed() == ise::execution::unknown) {
            if (hands) unconfirmed_ = made->epoch;
            throw ise::error(
                put.error().code(),
                fmt::format("it is not known whether the authority has changed; look at it, or ask again: {}",
                            put.error().message()),
                put.error().executed());
        }
        if (!put)
            throw ise::error(ise::errc::refused,
                             fmt::format("the authority stays as it is, as the change cannot be put to disk: {}",
                                         put.error().message()));
        if (*put) { // another node was first: decided anew
            set((*put)->first, (*put)->second);
            continue;
        }
        unconfirmed_.reset();
        set(next.first, next.second);
        peer_.notify_news();
        here_.self.log().info("authority over the boat", {{"how", hands ? made->how : who + " asks for it"},
                                                          {"epoch", std::to_string(made->epoch)}});
        if (hands) changed_hands_();
        break;
    }
    auto epoch = now().epoch;
    auto change = book_.change();
    while (peer_.lives() && !peer_.has_authority(epoch, change)) co_await peer_.wait_for_progress();
    co_return now();
}

} // namespace atirma
