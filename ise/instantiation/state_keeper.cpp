#include <ise/instantiation/state_keeper.hpp>

#include <fmt/format.h>

namespace ise::instantiation {

result<void> state_keeper::try_save() {
    saved_state state;
    state.boot = here_.host.boot();
    for (const auto& [path, one] : table_.instances()) state.instances.push_back(one->saved());
    for (const auto& [name, one] : table_.processes())
        state.processes.push_back(
            {name, one->program, one->mark, one->running ? one->running->stamp() : process_stamp{}, one->version});
    auto kept = save_state(here_.host, file(), state);
    if (!kept) here_.self.log().error(fmt::format("the state is not on disk: {}", kept.error().message()));
    return kept;
}

saved_state state_keeper::load() {
    std::string problem;
    auto before = load_state(here_.host, file(), problem);
    if (!problem.empty()) here_.self.log().error(problem);
    return before;
}

} // namespace ise::instantiation
