#include <components/foxglove_gateway/viewer_assets.hpp>

#include <ise/core/environment.hpp>

#include <fmt/format.h>

#include <chrono>
#include <string>

namespace ise::foxglove {

void viewer_assets::take(const std::shared_ptr<viewer>& who, fetch_asset_message& asked) {
    if (in_->options.assets.empty())
        return who->binary(write_asset_failure(asked.id, "this gateway has no assets (--assets)"));
    if (who->assets.size() >= who->limits().max_assets)
        return who->binary(write_asset_failure(asked.id, "too many assets were asked for (max_assets)"));
    who->assets.push_back(std::move(asked));
    if (!std::exchange(who->fetching, true)) in_->self.spawn("fetch assets", fetch(in_, who));
}

// The next is read when the viewer has taken the last.
task<> viewer_assets::fetch(std::shared_ptr<gateway_context> in, std::shared_ptr<viewer> who) {
    struct ending {
        viewer& mine;
        ~ending() { mine.fetching = false; }
    } guard{*who};
    while (!who->gone && !who->assets.empty()) {
        if (!who->idle()) {
            co_await in->self.sleep(std::chrono::milliseconds(50));
            continue;
        }
        auto asked = std::move(who->assets.front());
        who->assets.pop_front();
        auto path = asset_path(asked.uri);
        std::string why = path ? "" : path.error().message();
        if (path) {
            auto file = in->options.assets + "/" + *path;
            auto read = [&env = in->self.env(), file, most = in->options.max_asset_bytes] {
                return env.read_file(file, most);
            };
            result<std::string> content = co_await in->self.offload(std::move(read));
            if (content) who->binary(write_asset(asked.id, *content));
            else why = fmt::format("no asset '{}': {}", *path, name_of(content.error().code()));
        }
        if (!why.empty()) who->binary(write_asset_failure(asked.id, why));
    }
}

} // namespace ise::foxglove
