#include "commands.hpp"

#include "hosts.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace ise::cli {
namespace {

using instantiation::output_piece;

std::string shown(const context& in, const output_piece& piece) {
    if (in.set.json) {
        nlohmann::ordered_json told;
        told["offset"] = piece.offset;
        told["text"] = piece.text;
        return told.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
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

} // namespace

task<> logs(context& in, logs_options options) {
    auto found = co_await find_instance(in, options.host, options.name);
    auto server = found.host.server;
    subscriber<std::remove_const_t<decltype(instantiation::services::output)>> follow;
    if (options.follow) { // before it is asked what was printed so far, so that nothing falls between
        instantiation::follow_request wanted{options.name};
        auto terms = subscribe_options::last(1024);
        follow = co_await server.subscribe(instantiation::services::output, wanted, terms);
    }
    instantiation::output_request question{options.name, 1 << 20};
    auto told = co_await server.try_call(instantiation::services::last_output, std::move(question), in.left());
    if (!told) throw problem(told.error());
    auto& last = *told;
    auto end = last.offset + last.text.size();
    if (options.lines) keep_last_lines(last, *options.lines);
    if (!last.text.empty()) co_await in.out.write(in.self, shown(in, last));
    while (options.follow) {
        auto packet = co_await follow.next();
        if (!packet) throw problem(follow.cause());
        output_piece piece = *packet;
        if (piece.offset + piece.text.size() <= end) continue;
        if (piece.offset < end) piece.text.erase(0, end - piece.offset);
        else if (piece.offset > end)
            note(in.set, fmt::format("{} bytes were lost: it prints faster than they are read", piece.offset - end));
        end = packet->offset + packet->text.size();
        co_await in.out.write(in.self, shown(in, piece));
    }
}

} // namespace ise::cli
