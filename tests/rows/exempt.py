"""Array functions that nobody calls for a row and for a batch, by the reason."""

ONE_MEDIUM = "the medium is one process in either runtime, and knows all links; runs side by side: test_side_by_side.py"
ONE_WORLD = "the world is one process in either runtime, and knows all agents; runs side by side: test_side_by_side.py"
ONCE = "made once, before the flight, by whoever plans it"
WRITTEN = "of a run that was flown: what is written down, or judged"
WHOLE = "whole numbers, truths or copies: nothing is rounded"
SHAPES = "takes no arrays"
PROTOCOL = "a protocol"
FLOWN = "flies in test_bits.py"

EXEMPT = {
    ONE_MEDIUM: """
        netem.climate.Climate.begin netem.climate.Climate.rest netem.climate.Climate.judge
        netem.climate.Climate.bit_draws netem.climate.Climate.draw netem.medium.Verdicted.verdicts netem.medium.Medium.begin
        netem.medium.Medium.judge netem.medium.Medium.deliver netem.medium.Medium.bit_draws netem.medium.Medium.bias
        netem.rate.Rate.begin netem.rate.Rate.rest netem.rate.Rate.admit netem.jamming.Zone.jammed netem.trigger.Trigger.fires
        netem.timeline.Timeline.due netem.timeline.Timeline.clock netem.weather.Forecast.at netem.weather.Forecast.draw
        netem.draws.Tape.at
    """,
    WHOLE: """
        netem.air.Air.empty netem.air.deliver netem.air.newest_of netem.air.out_of_the_ordinary netem.arrow.named
        netem.arrow.places netem.cut.severed netem.cut.separated netem.fate.standing netem.fate.doom netem.fate.Ledger.of
        netem.links.Links.own_number netem.links.Links.ends netem.links.Links.degree netem.links.Links.present
        netem.links.Links.slots netem.links.Links.neighbours netem.links.Links.back netem.links.Links.touching
        netem.schedule.round_robin netem.schedule.slotted netem.timeline.Conditions.absent netem.timeline.Conditions.idle
        netem.timeline.Conditions.still netem.timeline.Conditions.coasting netem.timeline.Timeline.present
        netem.timeline.Timeline.held netem.weather.Forecast.acts netem.weather.Forecast.on
        agents.estimators.inputs.refuse_accelerations world.formation.Formation.is_leader world.history.Moments.ticks
        agents.returned.estimate agents.returned.said netem.broadcasts.fields netem.wire.numbers world.acts.Acts.read
        world.acts.Acts.beliefs world.sensors.stray world.dynamics.flown world.world.Scene.velocity
        analysis.sensor.Sensor.common
    """,
    ONE_WORLD: """
        world.pursued.Pursuit.begin world.pursued.Pursuit.sighting world.pursued.Pursuit.step world.sensors.astray
        world.world.World.begin world.world.World.target world.world.World.goal world.world.World.sighting
        world.world.World.measure world.world.World.outliers world.world.World.flown world.world.World.odometry
        world.world.World.step
    """,
    ONCE: """
        netem.chain.Chain.stationary netem.chain.Chain.burst_lengths netem.chain.ChainLayer.of netem.text.read
        netem.trace.from_csv netem.trace.table netem.trace.Measured.over netem.measured.delays netem.journal.carried
        world.maneuver.narrowest world.maneuver.turned world.stage.origin
        world.disturbance.Disturbance.between world.stress.incidence world.stress.laplacian
        world.stress.equilibrium world.stress.solve world.stress.stabilises analysis.cuts.smallest_cut
        analysis.localization.step analysis.localization.rates analysis.random_graphs.edges analysis.random_graphs.rates
        analysis.autoregressive.fit
    """,
    WRITTEN: """
        netem.journal.Writer.write netem.journal.Recorded.verdicts world.history.Vigil.errors
        world.history.Vigil.see world.history.History.extend world.history.History.arrays world.history.load
        world.history.digest world.history.one_nan world.localized.FirstMeasurements.of world.localized.FirstMeasurements.tick
        world.localized.FirstMeasurements.take world.localized.FirstMeasurements.edges world.realised.Realised.stabilised
        world.realised.Watch.follow world.realised.realise world.stage.points world.stage.scalars analysis.claims.flat
        analysis.claims.approaches analysis.claims.lower analysis.claims.ratio analysis.claims.stays_below
        analysis.claims.leaves analysis.claims.exponential analysis.claims.never_above analysis.claims.below_in_mean
        analysis.claims.within analysis.figures.evolution analysis.figures.rates analysis.figures.indicator
        analysis.target_figures.agreement
    """,
    SHAPES: """
        agents.centre.Centre.begin agents.estimators.geometry.identity agents.estimators.inputs.at_rest
        agents.estimators.kalman.motion agents.estimators.kalman.embedded agents.estimators.kalman.unknown
        agents.estimators.rkf.EdgeFilters.unknown
    """,
    PROTOCOL: """
        agents.controllers.Law.command agents.estimators.base.Estimator.sense agents.estimators.base.Estimator.fuse
        agents.estimators.constraints.Maps.feasible agents.estimators.constraints.Maps.fit
        agents.estimators.constraints.Maps.nearest agents.estimators.constraints.Maps.covariance
    """,
    FLOWN: """
        agents.agent.Agent.init agents.agent.Agent.sense agents.agent.Agent.act
    """,
}
NAMES = [name for names in EXEMPT.values() for name in names.split()]
