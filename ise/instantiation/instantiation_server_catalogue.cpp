#include <ise/instantiation/instantiation_server.hpp>

#include <fmt/format.h>

namespace ise::instantiation {
namespace {

constexpr std::size_t max_description_bytes = 1 << 20;
constexpr duration try_problems_again_after = std::chrono::seconds(10); // a busy machine may have been one

} // namespace

/// Asks every program of the folder what it has: installing one is enough.
task<> instantiation_server::read_catalogue() {
    while (reading_catalogue_) co_await sleep(std::chrono::milliseconds(10));
    auto found = host_.programs(options_.programs_folder);
    std::vector<program_file> programs;
    if (found) programs = std::move(*found);
    bool as_before = catalogue_ && programs == programs_ &&
                     (catalogue_->problems().empty() || now() - catalogue_read_ < try_problems_again_after);
    if (as_before) co_return;
    struct reading { // whichever way this coroutine ends
        bool& flag;
        ~reading() { flag = false; }
    } guard{reading_catalogue_};
    reading_catalogue_ = true;
    auto fresh = std::make_unique<catalogue>();
    if (!found) fresh->add_problem(found.error().message());
    std::size_t count = 0;
    for (const auto& one : programs) {
        const auto& name = one.name;
        if (++count > catalogue::max_programs) {
            fresh->add_problem(fmt::format("{} has more than {} programs: the others are left out",
                                           options_.programs_folder, catalogue::max_programs));
            break;
        }
        if (!one.objection.empty()) {
            fresh->add_problem(fmt::format("{}: {}", name, one.objection));
            continue;
        }
        auto told = co_await host_.ask(on(), options_.programs_folder + "/" + name, max_description_bytes,
                                       options_.describe_within);
        if (told) fresh->add(name, *told);
        else fresh->add_problem(told.error().message());
    }
    catalogue_ = std::move(fresh);
    programs_ = std::move(programs);
    catalogue_read_ = now();
}

task<types_response> instantiation_server::tell_types() {
    co_await read_catalogue();
    co_return catalogue_->tell();
}

task<launch_plan> instantiation_server::plan(start_request request) {
    auto made = catalogue_ ? catalogue_->plan(request, options_.rules, env().random())
                           : result<launch_plan>(failure(errc::invalid_argument, "starting"));
    if (!made) { // perhaps it was installed meanwhile
        co_await read_catalogue();
        made = catalogue_->plan(request, options_.rules, env().random());
    }
    co_return std::move(made).value();
}

} // namespace ise::instantiation
