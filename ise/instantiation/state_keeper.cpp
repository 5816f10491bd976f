#include <ise/instantiation/state_keeper.hpp>

#include <fmt/format.h>

namespace ise::instantiation {

saved_state state_keeper::now() const {
    saved_state state;
    state.boot = here_.host.boot();
    for (const auto& [path, one] : table_.instances()) state.instances.push_back(one->saved());
    for (const auto& [name, one] : table_.processes())
        state.processes.push_back(
            {name, one->program, one->mark, one->running ? one->running->stamp() : process_stamp{}, one->version});
    return state;
}

void state_keeper::check_room(const start_request& more) const {
    auto state = now();
    state.instances.emplace_back().asked = more;
    if (text_of(state, max_accepted_bytes)) return;
    throw error(errc::overloaded, fmt::format("with it the state of this instantiation server would exceed {} bytes "
                                              "(max_accepted_bytes): ise stop --forget instances that are not needed",
                                              max_accepted_bytes));
}

result<void> state_keeper::try_save() {
    if (!began_) return {};
    kept_ = save_state(here_.host, file(), now());
    if (!kept_) here_.self.log().error(fmt::format("the state is not on disk: {}", kept_.error().message()));
    return kept_;
}

saved_state state_keeper::load() {
    std::string problem;
    auto before = load_state(here_.host, file(), problem);
    if (!problem.empty()) here_.self.log().error(problem);
    return before;
}

void state_keeper::begin() {
    began_ = true;
    save();
}

} // namespace ise::instantiation
