#include <ise/component/traced_work.hpp>

#include <ise/service/service_host.hpp>

namespace ise {

bool traces_work(const component& by) noexcept { return by.services().options().traces != nullptr; }

void record_work(const component& by, const traced_work& work, std::uint64_t id) {
    auto* traces = by.services().options().traces.get();
    if (!traces || !work.in) return;
    traces->ended(work.in, id != 0 ? id : traces->next_id(), span::side::internal, work.outcome, work.began, work.took,
                  work.name, by.path(), work.target, work.linked);
}

} // namespace ise
