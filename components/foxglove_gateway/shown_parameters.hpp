#pragma once
#include <components/foxglove_gateway/gateway_context.hpp>
#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <ise/core/task.hpp>

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ise::foxglove {

/// The parameters of components as viewers get, set and follow them: "atirma/boat/wind-speed" is the parameter
/// `wind-speed` of `atirma/boat`. Used on the component's loop.
class shown_parameters : public std::enable_shared_from_this<shown_parameters> {
public:
    shown_parameters(std::shared_ptr<gateway_context> in, std::shared_ptr<viewer_sessions> to)
        : in_(std::move(in)), to_(std::move(to)) {}

    void take(const std::shared_ptr<viewer>& who, get_parameters_message& asked);
    void take(const std::shared_ptr<viewer>& who, set_parameters_message& asked);
    void take(const std::shared_ptr<viewer>& who, const parameter_updates_message& asked);
    /// The component is gone.
    void forget(const std::string& path) { told_.erase(path); }
    /// Asks for parameters that viewers follow.
    void tick();

private:
    static task<> get(std::shared_ptr<shown_parameters> me, std::shared_ptr<viewer> who, get_parameters_message asked,
                      viewer_sessions::operation under_way);
    static task<> set(std::shared_ptr<shown_parameters> me, std::shared_ptr<viewer> who, set_parameters_message asked,
                      viewer_sessions::operation under_way);
    static task<> read(std::shared_ptr<shown_parameters> me, std::string path);
    static task<> follow(std::shared_ptr<shown_parameters> me);
    void refresh(const std::string& path, std::vector<parameter_info> now);
    bool has_parameters(const std::string& path) const;
    std::set<std::string> owners(const std::vector<std::string>& names) const;
    void tell(viewer& who, const std::vector<std::string>& names, const std::optional<std::string>& id);

    std::shared_ptr<gateway_context> in_;
    std::shared_ptr<viewer_sessions> to_;
    std::map<std::string, std::vector<parameter_info>> told_; // by path, as viewers were told last
    bool following_ = false;
    time_point followed_at_{};
};

} // namespace ise::foxglove
