#include <components/gui_client/authority_client.hpp>

namespace atirma::console {
namespace {
constexpr ise::duration authority_deadline = std::chrono::seconds(15);
} // namespace

ise::task<> authority_client::change(change_authority what) {
    auto& state = context_.state;
    auto settle = [this](bool under_way, std::string problem) {
        context_.state.asks_authority(under_way, std::move(problem));
        context_.news();
    };
    if (context_.role.empty())
        co_return settle(false, "no communication node was found: nobody can have the authority");
    if (context_.self.path().empty()) co_return settle(false, "this console has no name: it cannot hold the authority");
    settle(true, std::string());
    auto nodes = context_.self.at(context_.role);
    auto answer = co_await nodes.try_call(services::authority, what.request, authority_deadline);
    if (answer) state.on_authority(*answer, context_.clock());
    settle(false, answer ? std::string() : answer.error().message());
}

ise::task<std::string> authority_client::acquire(taking how) {
    const auto& authority = context_.state.authority();
    if (how == taking::no || context_.role.empty() || authority.mine()) co_return std::string();
    change_authority what;
    what.request.action = authority_action::take;
    what.request.confirmed = how == taking::from_holder;
    auto changed = change(std::move(what));
    co_await std::move(changed);
    co_return authority.problem;
}

} // namespace atirma::console
