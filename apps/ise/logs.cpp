// ise logs: what an instance has printed.
#include "hosts.hpp"
#include "json.hpp"
#include "options.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <memory>

namespace ise::cli {
namespace {

using instantiation::output_piece;

struct logs_options {
    std::string name, host;
    bool follow = false;
    std::optional<std::size_t> lines;
};

struct log_line {
    std::uint64_t offset = 0;
    std::string text;
};

std::string show_piece(const context& in, const output_piece& piece) {
    if (in.set.json) {
        log_line line{piece.offset, piece.text};
        return json_line(line);
    }
    // What a program printed is not for the terminal to obey.
    return in.out.is_terminal() ? printable(piece.text, true) : piece.text;
}

void keep_last_lines(output_piece& piece, std::size_t lines) {
    auto from = piece.text.size();
    if (piece.text.ends_with('\n')) --from;
    for (std::size_t line = 0; line < lines; ++line) {
        if (from == 0 || (from = piece.text.rfind('\n', from - 1)) == std::string::npos) return;
    }
    piece.text.erase(0, from + 1);
    piece.offset += from + 1;
}

task<> logs(context& in, logs_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    auto server = found.host.server;
    subscriber<std::remove_const_t<decltype(instantiation::services::output)>> follow;
    if (options.follow) { // before it is asked what was printed so far, so that nothing falls between
        instantiation::follow_request wanted{options.name};
        auto terms = subscribe_options::keep_last(1024);
        follow = co_await server.subscribe(instantiation::services::output, wanted, terms);
    }
    instantiation::output_request question{options.name, 1 << 20};
    auto response = co_await server.try_call(instantiation::services::last_output, std::move(question), in.left());
    if (!response) throw problem(response.error());
    auto& last = *response;
    auto end = last.offset + last.text.size();
    if (options.lines) keep_last_lines(last, *options.lines);
    if (!last.text.empty()) co_await in.out.write(in.self, show_piece(in, last));
    while (options.follow) {
        auto packet = co_await follow.next();
        if (!packet) throw problem(follow.cause());
        output_piece piece = *packet;
        if (piece.offset + piece.text.size() <= end) continue;
        if (piece.offset < end) piece.text.erase(0, static_cast<std::size_t>(end - piece.offset));
        else if (piece.offset > end)
            note(in.set, fmt::format("{} bytes were lost: it prints faster than they are read", piece.offset - end));
        end = packet->offset + packet->text.size();
        co_await in.out.write(in.self, show_piece(in, piece));
    }
}

void declare_logs(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<logs_options>();
    app.add_option("INSTANCE", given->name, "its path: ise ps")->required();
    add_host(app, given->host);
    app.add_flag("--follow,-f", given->follow, "continue with new output");
    app.add_option("--lines,-n", given->lines, "only the last N lines")->type_name("N");
    app.callback([&made, given] {
        made.endless = given->follow;
        made.work = [given](context& in) { return logs(in, *given); };
    });
}

} // namespace

extern const command logs_command{"logs", run_group, "shows the output of a component",
                                  "  ise logs sea/wind -n 20\n  ise logs sea/wind --follow\n", declare_logs};

} // namespace ise::cli
