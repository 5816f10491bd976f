#pragma once
#include <components/gui_client/telecommand_sender.hpp>

#include <string>

namespace atirma::console {

/// Changes the boat's list of waypoints by several telecommands, one after the other.
class mission_control {
public:
    /// `poll`: how often it looks whether the list has been read back.
    mission_control(client_context& context, telecommand_sender& sender, ise::duration poll)
        : context_(context), sender_(sender), poll_(poll) {}

    /// Stages place by place, tells the boat to use them, reads the list back and compares; the state shows how far it
    /// is. Until then the boat keeps its list. One at a time.
    void upload(upload_mission what);
    void cancel();
    /// Puts a place before the active one, and sails there. Cancellation: terminal.
    ise::task<> sail(sail_to what);

private:
    ise::task<> run_upload(upload_mission what);
    ise::task<std::string> send_points(const upload_mission& what);
    ise::task<bool> read_back(std::string via, const bool* stop);
    ise::task<> read_back_once(std::string via);
    void show(upload_phase phase, std::size_t done, std::size_t total, std::string text);
    void show_text(std::string text);

    client_context& context_;
    telecommand_sender& sender_;
    ise::duration poll_;
    bool running_ = false, cancelled_ = false;
};

} // namespace atirma::console
