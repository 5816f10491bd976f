#include <components/gui_client/gui_client.hpp>

namespace atirma::console {
namespace {
constexpr ise::duration settles = std::chrono::seconds(10);
} // namespace

gui_client::gui_client(gui_client_options options)
    : options_(std::move(options)), state_(std::make_unique<console_state>(options_.state)) {
    if (!options_.port) options_.port = std::make_shared<operator_port>();
}
gui_client::~gui_client() { options_.port->close(); }

utc_time gui_client::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

ise::task<> gui_client::run() {
    state_ = std::make_unique<console_state>(options_.state);
    followed_.clear();
    connected_.clear();
    trouble_.clear();
    present_.clear();
    looked_at_.clear();
    nodes_.clear();
    recorded_.clear();
    role_followed_ = false;
    state_->set_self(path());
    commands_in_hand_ = 0;
    uploading_ = cancel_upload_ = false;
    struct closing {
        gui_client& self;
        ~closing() { self.options_.port->close(); }
    } guard{*this};
    options_.port->open(on().gate(), [this] { carry_out(); });
    require(services::telemetry);
    require(services::telecommand);
    require(services::telecommand_state);
    require(services::xb_local);
    require(services::xb_local_param);
    require(services::authority);
    require(services::communication);
    for (const auto& path : options_.proxies)
        follow(path, {"telemetry", "telecommand", "telecommand_state", "xb_local", "gprs_state", "iridium_account"});
    if (options_.name_server) spawn("names", watch_names());
    // At first only some of what is there has been heard: nobody is called for the rest.
    for (auto settled = now() + settles;;) {
        if (now() >= settled) state_->on_time(clock());
        publish_snapshot();
        co_await sleep(options_.tick);
    }
}

void gui_client::publish_snapshot() {
    watch_streams();
    if (!dirty_ && now() - published_ < options_.max_quiet && published_ != ise::time_point{}) return;
    dirty_ = false;
    published_ = now();
    options_.port->publish(state_->view(clock()));
}

void gui_client::watch_streams() {
    for (const auto& [path, services] : followed_) {
        if (!services.contains("telemetry")) continue;
        auto found = connected_.find(path);
        bool is = found != connected_.end() && found->second();
        const auto& links = state_->links();
        auto known = links.find(path);
        bool was = known != links.end() && known->second.connected;
        if (is != was) news();
        state_->on_link(path, is,
                        is                          ? std::string()
                        : found != connected_.end() ? std::string("its proxy is not reached")
                                                    : trouble_[path],
                        clock());
    }
    for (const auto& path : nodes_) {
        auto found = connected_.find(path);
        bool is = found != connected_.end() && found->second();
        state_->on_node(path, is, is ? std::string() : trouble_[path], nullptr, clock());
    }
    finding_view finding;
    finding.uses_names = options_.name_server.has_value();
    finding.where = options_.name_server ? options_.name_server->text() : std::string();
    for (const auto& path : options_.proxies) finding.where += (finding.where.empty() ? "" : ", ") + path;
    finding.looking_for = "telemetry below " + options_.space;
    finding.reached = names_connected_ && names_connected_();
    finding.trouble = finding.reached    ? std::string()
                      : names_connected_ ? std::string("it is not reached")
                                         : names_trouble_;
    state_->on_finding(std::move(finding));
}

} // namespace atirma::console
