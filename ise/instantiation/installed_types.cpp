#include <ise/instantiation/installed_types.hpp>

#include <fmt/format.h>

namespace ise::instantiation {
namespace {

constexpr std::size_t max_description_bytes = 1 << 20;
constexpr duration try_problems_again_after = std::chrono::seconds(10); // a busy machine may have been one

} // namespace

task<> installed_types::refresh() {
    while (reading_) co_await here_.self.sleep(std::chrono::milliseconds(10));
    const auto& options = here_.options;
    auto found = here_.host.programs(options.programs_folder);
    std::vector<program_file> programs;
    if (found) programs = std::move(*found);
    bool as_before = read_at_ && programs == programs_ &&
                     (catalogue_.problems().empty() || here_.self.now() - *read_at_ < try_problems_again_after);
    if (as_before) co_return;
    struct reading { // whichever way this coroutine ends
        bool& flag;
        ~reading() { flag = false; }
    } guard{reading_};
    reading_ = true;
    catalogue fresh;
    if (!found) fresh.add_problem(found.error().message());
    std::size_t count = 0;
    for (const auto& one : programs) {
        const auto& name = one.name;
        if (++count > catalogue::max_programs) {
            fresh.add_problem(fmt::format("{} has more than {} programs: the others are left out",
                                          options.programs_folder, catalogue::max_programs));
            break;
        }
        if (!one.objection.empty()) {
            fresh.add_problem(fmt::format("{}: {}", name, one.objection));
            continue;
        }
        auto info = co_await here_.host.ask(here_.self.on(), options.programs_folder + "/" + name,
                                            max_description_bytes, options.describe_within);
        if (info) fresh.add(name, *info);
        else fresh.add_problem(info.error().message());
    }
    catalogue_ = std::move(fresh);
    programs_ = std::move(programs);
    read_at_ = here_.self.now();
}

task<types_response> installed_types::describe() {
    co_await refresh();
    co_return catalogue_.tell();
}

task<launch_plan> installed_types::plan(start_request request) {
    auto made = catalogue_.plan(request, here_.options.rules, here_.self.env().random());
    if (!made) { // perhaps it was installed meanwhile
        co_await refresh();
        made = catalogue_.plan(request, here_.options.rules, here_.self.env().random());
    }
    co_return std::move(made).value();
}

} // namespace ise::instantiation
