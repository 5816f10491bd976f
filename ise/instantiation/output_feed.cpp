#include <ise/instantiation/access.hpp>
#include <ise/instantiation/output_feed.hpp>

#include <fmt/format.h>

#include <set>

namespace ise::instantiation {

output_feed::output_feed(server_context& here, const instance_table& table) : here_(here), table_(table) {
    publication_callbacks<std::remove_const_t<decltype(services::output)>> callbacks;
    callbacks.on_subscribe = [this](const follow_request& request, const subscriber_info& who) -> result<nothing> {
        auto by = peer_of(who);
        if (auto denied = objection_to_read(here_, &by, request.path, true)) return std::move(*denied);
        if (!table_.find(request.path))
            return failure(errc::refused,
                           fmt::format("no instance '{}' was started here", request.path.substr(0, 200)));
        followers_[who.number] = request.path;
        return nothing();
    };
    callbacks.on_unsubscribe = [this](const nothing&, const subscriber_info& who) {
        followers_.erase(who.number);
        return nothing();
    };
    output_ = here_.self.publish(services::output, std::move(callbacks));
    look_ = std::make_unique<timer>(here_.self.on(), [this] { look(); });
    look();
}

void output_feed::look() {
    std::map<output_file*, std::set<std::string>> files; // several paths may share one
    for (const auto& [path, one] : table_.instances()) files[one->output.get()].insert(path);
    for (auto& [file, paths] : files) {
        std::set<std::string> followed;
        for (const auto& [number, path] : followers_)
            if (paths.contains(path)) followed.insert(path);
        auto piece = file->look(!followed.empty());
        if (piece.text.empty()) continue;
        for (const auto& path : followed) {
            piece.path = path;
            output_.publish_if(piece, [&](const subscriber_info& who) {
                auto found = followers_.find(who.number);
                auto by = peer_of(who);
                return found != followers_.end() && found->second == path &&
                       !objection_to_read(here_, &by, path, false);
            });
        }
    }
    look_->arm(saturating_add(here_.self.now(), here_.options.look_every));
}

} // namespace ise::instantiation
