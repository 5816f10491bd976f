// ise trace: the way of one call through components, from the spans that they wrote.
#include "json.hpp"
#include "options.hpp"
#include "span_tree.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

namespace ise::cli {
namespace {

constexpr std::size_t max_spans_file = std::size_t{256} << 20;

struct trace_options {
    std::vector<std::string> files;
    std::string id; ///< the beginning; empty: the trace that began last
};

task<> trace(context& in, trace_options options) {
    std::vector<traced_span> all;
    for (const auto& file : options.files) {
        auto text = in.self.env().read_file(file, max_spans_file);
        if (!text)
            throw problem(exit_code::usage, "file", text.error().message(),
                          "name files that programs wrote with --traces FILE or ISE_TRACES");
        auto read = read_spans(*text, all);
        if (!read)
            throw problem(exit_code::mismatch, "malformed", fmt::format("{}: {}", file, read.error().message()),
                          "name files that programs wrote with --traces FILE or ISE_TRACES");
    }
    auto spans = spans_of_trace(all, options.id);
    if (spans.empty())
        throw problem(exit_code::failed, "no_trace",
                      options.id.empty() ? "there are no spans in these files"
                                         : fmt::format("no trace begins with '{}'", printable(options.id)),
                      "spans are written once a second, and when a program ends");
    std::string drawn;
    if (in.set.json) drawn = json_line(spans);
    else drawn = draw_trace(spans);
    co_await in.out.write(in.self, std::move(drawn));
}

void declare_trace(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<trace_options>();
    app.add_option("FILE", given->files, "that programs wrote (--traces FILE, ISE_TRACES); several are read as one")
        ->required();
    app.add_option("--id", given->id, "of the trace, or its beginning (default: the one that began last)")
        ->type_name("HEX");
    app.callback([&made, given] { made.work = [given](context& in) { return trace(in, *given); }; });
}

} // namespace

extern const command trace_command{"trace", measure_group, "draws the way of one call through components",
                                   "  ise trace spans.jsonl\n  ise trace boat.jsonl shore.jsonl --id 4bf92f\n",
                                   declare_trace};

} // namespace ise::cli
